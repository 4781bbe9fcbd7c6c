"""How a viewer opens: a tab for driving, one for the arm, one for the bus; cameras that look at the cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from services.viewer.geometry import rotation_matrices
from services.viewer.items import MAP, TIMELINE
from services.viewer.picture import Cast

EMPTY_HALL = ((-5.0, -5.0, 0.0), (5.0, 5.0, 1.0))
PLOT_SECONDS = 60.0
_LEGEND = rrb.PlotLegend(corner="lefttop")
_WINDOW = rrb.VisibleTimeRange(
    TIMELINE,
    start=rrb.TimeRangeBoundary.cursor_relative(seconds=-PLOT_SECONDS),
    end=rrb.TimeRangeBoundary.cursor_relative(),
)
_BACKGROUND = rrb.Background(color=(28, 31, 38))


def blueprint(cast: Cast) -> rrb.Blueprint:
    """The layout for those who are to be seen."""
    tabs: list[rrb.Container | rrb.View] = []
    if cast.chassis:
        tabs.append(_driving(cast))
    if cast.arms:
        tabs.append(_arm(cast))
    tabs.append(_bus())
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="following"),
        auto_views=False,
    )


def _driving(cast: Cast) -> rrb.Container:
    robots = cast.chassis
    below = [f"- /{arm}/frames/**" for arm in cast.arms]
    return rrb.Horizontal(
        rrb.Vertical(_scene("Cell", cast, below, _overview(cast)), _log("Moves", robots), row_shares=[4, 1]),
        rrb.Vertical(
            _scene("From above", cast, [*below, "- /scene/world/**"], _from_above(cast)),
            _plot("Speed", robots, "speed"),
            _plot("Battery and jack", robots, "charge", (0, 100)),
            row_shares=[2, 1, 1],
        ),
        column_shares=[2, 1],
        name="Driving",
    )


def _arm(cast: Cast) -> rrb.Container:
    arms = cast.arms
    return rrb.Horizontal(
        rrb.Vertical(_scene("Arm", cast, [], _close_up(cast)), _log("Control", arms), row_shares=[4, 1]),
        rrb.Vertical(
            _plot("Joint speeds", arms, "joints/velocity"),
            _plot("Tracking error", arms, "error"),
            _plot("Time of a tick and of the solver", arms, "loop"),
            _plot("Iterations, late ticks", arms, "counts"),
        ),
        column_shares=[3, 2],
        name="Arm",
    )


def _bus() -> rrb.Container:
    return rrb.Vertical(
        rrb.Horizontal(
            rrb.TimeSeriesView(
                origin="/bus/lost",
                name="Lost: pushed out unread, or malformed",
                plot_legend=_LEGEND,
                time_ranges=_WINDOW,
            ),
            rrb.TimeSeriesView(origin="/bus/received", name="Received", plot_legend=_LEGEND, time_ranges=_WINDOW),
        ),
        rrb.TextLogView(origin="/bus/log", name="Who came and went"),
        row_shares=[2, 1],
        name="Bus",
    )


def _plot(name: str, robots: Sequence[str], entity: str, span: tuple[float, float] | None = None) -> rrb.View:
    contents = [f"/{robot}/{entity}/**" for robot in robots]
    axis = rrb.ScalarAxis(range=span) if span else None
    return rrb.TimeSeriesView(
        origin="/", contents=contents, name=name, axis_y=axis, plot_legend=_LEGEND, time_ranges=_WINDOW
    )


def _log(name: str, robots: Sequence[str]) -> rrb.View:
    return rrb.TextLogView(origin="/", contents=[f"/{robot}/log" for robot in robots], name=name)


def _scene(name: str, cast: Cast, without: Sequence[str], eye: rrb.EyeControls3D) -> rrb.View:
    return rrb.Spatial3DView(
        origin="/",
        contents=["/scene/**", "/tf", *(f"/{robot}/**" for robot in (*cast.chassis, *cast.arms)), *without],
        name=name,
        background=_BACKGROUND,
        line_grid=rrb.LineGrid3D(visible=False),
        spatial_information=rrb.SpatialInformation(target_frame=MAP, axes=rr.ViewCoordinates.RIGHT_HAND_Z_UP),
        eye_controls=eye,
    )


# -- cameras -----------------------------------------------------------------------------------------------------------


def _overview(cast: Cast) -> rrb.EyeControls3D:
    """From the south, high enough to look over walls."""
    low, high = np.array(cast.bounds or EMPTY_HALL)
    middle, reach = (low + high) / 2, float(np.max((high - low)[:2]))
    position = middle + np.array([-0.12, -0.62, 0.62]) * reach
    return rrb.EyeControls3D(position=position, look_target=(middle[0], middle[1], 0.0), eye_up=(0, 0, 1))


def _from_above(cast: Cast) -> rrb.EyeControls3D:
    low, high = np.array(cast.bounds or EMPTY_HALL)
    middle, reach = (low + high) / 2, float(np.max((high - low)[:2]))
    return rrb.EyeControls3D(
        position=(middle[0], middle[1] - 0.01, 1.15 * reach), look_target=(middle[0], middle[1], 0), eye_up=(0, 1, 0)
    )


def _close_up(cast: Cast) -> rrb.EyeControls3D:
    """Beside the first arm, in front of its tool."""
    stand = cast.stands[0]
    turn = rotation_matrices(np.array([stand.orientation]))[0]
    base, tool = np.array(stand.position), turn @ np.array(stand.tool)
    ahead = np.array([*tool[:2], 0.0]) / max(float(np.hypot(*tool[:2])), 1e-6)
    aside = np.array([-ahead[1], ahead[0], 0.0])
    target = base + 0.35 * ahead + np.array([0.0, 0.0, 0.2])
    return rrb.EyeControls3D(
        position=target + 1.1 * ahead + 1.5 * aside + np.array([0.0, 0.0, 0.7]), look_target=target, eye_up=(0, 0, 1)
    )
