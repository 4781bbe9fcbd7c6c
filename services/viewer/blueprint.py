"""How a viewer opens: a tab for driving, one for the arm, one for the bus; cameras that look at the cell."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from rackhand.services.viewer.geometry import EMPTY_HALL, rotation_matrices
from rackhand.services.viewer.items import BUS_LOG, MAP, TIMELINE
from rackhand.services.viewer.picture import RobotSet

PLOT_SECONDS = 60.0
_LEGEND = rrb.PlotLegend(corner="lefttop")
_WINDOW = rrb.VisibleTimeRange(
    TIMELINE,
    start=rrb.TimeRangeBoundary.cursor_relative(seconds=-PLOT_SECONDS),
    end=rrb.TimeRangeBoundary.cursor_relative(),
)
_BACKGROUND = rrb.Background(color=(28, 31, 38))


# What the views look at, by the name of its robot.
CHASSIS_SHAPES = (
    *("name", "footprint", "outline", "scan", "map", "overlays", "costmap", "path", "trail", "target"),
    *("rack/carried", "rack/floor", "rack/detected", "rack/legs", "rack/staging", "rack/points", "rack/seen"),
)
ARM_SHAPES = ("name", "path", "way_points", "trail", "frames/mount", "frames/tool", "frames/target")
LIFT_SHAPES = ("cabin", "doors", "state")
CHASSIS_PLOTS = {
    "Speed": ("speed/forward", "speed/forward_wanted", "speed/turning", "speed/turning_wanted"),
    "Battery and jack": ("charge/battery", "charge/jack"),
}
ARM_PLOTS = {
    "Joint speeds": ("joints/velocity",),
    "Tracking error": ("error/linear", "error/angular"),
    "Time of a tick and of the solver": ("loop/tick", "loop/solver"),
    "Solver iterations, late ticks": ("counts/iterations", "counts/late_ticks"),
}
LOG = "log"
CAUSE, THINGS = "cause", "things"  # of a move that is explained
SCENE, FRAMES = "scene", "tf"
BUS_PLOTS = {"Lost: dropped or malformed": "bus/lost", "Received": "bus/received"}
Paths = tuple[str, ...]


def shown(cast: RobotSet) -> Paths:
    """Every entity that the layout looks at. Under ``SCENE`` and the entities of ``BUS_PLOTS`` there is one a thing."""
    chassis = (*CHASSIS_SHAPES, *_flat(CHASSIS_PLOTS.values()), LOG)
    arm = (*ARM_SHAPES, *_flat(ARM_PLOTS.values()), LOG)
    return (
        *_of(cast.chassis, chassis if cast.chassis else ()),
        *_of(cast.arms, arm if cast.arms else ()),
        *_of(cast.lifts, (*LIFT_SHAPES, LOG)),
        *(SCENE, FRAMES, *BUS_PLOTS.values(), BUS_LOG),
    )


def blueprint(cast: RobotSet) -> rrb.Blueprint:
    """The layout for those who are to be seen."""
    tabs = [*([_driving(cast)] if cast.chassis else ()), *([_arm(cast)] if cast.arms else ()), _bus()]
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        auto_views=False,
    )


def move_blueprint(cast: RobotSet) -> rrb.Blueprint:
    """The layout for the recording of one move: the place from above, the words, the speeds."""
    shapes = _of(cast.chassis, (*(shape for shape in CHASSIS_SHAPES if shape != "name"), THINGS))
    words = [rrb.TextDocumentView(origin=f"/{robot}/{CAUSE}", name="Cause") for robot in cast.chassis]
    plot = _plot("Speed", _of(cast.chassis, CHASSIS_PLOTS["Speed"]))
    return rrb.Blueprint(
        rrb.Horizontal(
            _space("From above", shapes, _from_above(cast)),
            rrb.Vertical(*words, plot, _log("Moves", _of(cast.chassis, (LOG,)))),
            column_shares=[3, 2],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        auto_views=False,
    )


def _driving(cast: RobotSet) -> rrb.Container:
    robots = cast.chassis
    shapes = (*_of(robots, CHASSIS_SHAPES), *_of(cast.arms, ("name", "path", "trail")))
    above = tuple(shape for shape in shapes if not shape.endswith("/name"))
    speed, charge = (_plot(name, _of(robots, entities)) for name, entities in CHASSIS_PLOTS.items())
    return rrb.Horizontal(
        rrb.Vertical(_space("Cell", shapes, _overview(cast)), _log("Moves", _of(robots, (LOG,))), row_shares=[4, 1]),
        rrb.Vertical(_space("From above", above, _from_above(cast)), speed, charge, row_shares=[2, 1, 1]),
        column_shares=[2, 1],
        name="Driving",
    )


def _arm(cast: RobotSet) -> rrb.Container:
    arms = cast.arms
    shapes = (*_of(arms, ARM_SHAPES), *_of(cast.chassis, ("name", "footprint", "scan", "path")))
    return rrb.Horizontal(
        rrb.Vertical(_space("Arm", shapes, _close_up(cast)), _log("Control", _of(arms, (LOG,))), row_shares=[4, 1]),
        rrb.Vertical(*(_plot(name, _of(arms, entities)) for name, entities in ARM_PLOTS.items())),
        column_shares=[3, 2],
        name="Arm",
    )


def _bus() -> rrb.Container:
    plots = (_plot(name, (f"{entity}/**",)) for name, entity in BUS_PLOTS.items())
    return rrb.Vertical(rrb.Horizontal(*plots), _log("Liveliness and time", (BUS_LOG,)), row_shares=[2, 1], name="Bus")


def _of(robots: Iterable[str], names: Iterable[str]) -> Paths:
    return tuple(f"{robot}/{name}" for robot in robots for name in names)


def _flat(groups: Iterable[Paths]) -> Paths:
    return tuple(name for group in groups for name in group)


def _contents(entities: Paths) -> list[str]:
    return [f"+ /{entity}" for entity in entities]


def _plot(name: str, entities: Paths) -> rrb.View:
    return rrb.TimeSeriesView(
        origin="/", contents=_contents(entities), name=name, plot_legend=_LEGEND, time_ranges=_WINDOW
    )


def _log(name: str, entities: Paths) -> rrb.View:
    return rrb.TextLogView(origin="/", contents=_contents(entities), name=name)


def _space(name: str, shapes: Paths, eye: rrb.EyeControls3D) -> rrb.View:
    return rrb.Spatial3DView(
        origin="/",
        contents=_contents((f"{SCENE}/**", FRAMES, *shapes)),
        name=name,
        background=_BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        spatial_information=rrb.SpatialInformation(target_frame=MAP, axes=rr.ViewCoordinates.RIGHT_HAND_Z_UP),
        eye_controls=eye,
    )


# -- cameras -----------------------------------------------------------------------------------------------------------


def _overview(cast: RobotSet) -> rrb.EyeControls3D:
    """From the south, high enough to look over walls."""
    low, high = np.array(cast.bounds or EMPTY_HALL)
    middle, reach = (low + high) / 2, float(np.max((high - low)[:2]))
    position = middle + np.array([-0.1, -0.6, 0.62]) * reach
    return rrb.EyeControls3D(position=position, look_target=(middle[0], middle[1], 0.0), eye_up=(0, 0, 1))


def _from_above(cast: RobotSet) -> rrb.EyeControls3D:
    low, high = np.array(cast.bounds or EMPTY_HALL)
    middle, reach = (low + high) / 2, float(np.max((high - low)[:2]))
    return rrb.EyeControls3D(
        position=(middle[0], middle[1] - 0.01, 0.95 * reach), look_target=(middle[0], middle[1], 0), eye_up=(0, 1, 0)
    )


def _close_up(cast: RobotSet) -> rrb.EyeControls3D:
    """Beside the first arm and in front of its tool; on that side of it where there is more room."""
    mount = cast.mounts[0]
    turn = rotation_matrices(np.array([mount.orientation]))[0]
    base, tool = np.array(mount.position), turn @ np.array(mount.tool)
    ahead = np.array([*tool[:2], 0.0]) / max(float(np.hypot(*tool[:2])), 1e-6)
    aside = np.array([-ahead[1], ahead[0], 0.0])
    target = base + 0.35 * ahead + np.array([0.0, 0.0, 0.15])
    low, high = np.array(cast.bounds or EMPTY_HALL)
    eyes = [target + 0.8 * ahead + side * 1.3 * aside + np.array([0.0, 0.0, 0.6]) for side in (1, -1)]
    eye = max(eyes, key=lambda eye: float(np.minimum(eye - low, high - eye)[:2].min()))
    return rrb.EyeControls3D(position=eye, look_target=target, eye_up=(0, 0, 1))
