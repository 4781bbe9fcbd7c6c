"""A chassis: its measurements, pose, plans and events, as shapes, curves and lines of a log."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import (
    Battery,
    ChassisCommand,
    ChassisFootprint,
    ChassisModel,
    ChassisStatus,
    Contacts,
    Costmap,
    Jack,
    LocalisedPose,
    Odometry,
    Scan,
)
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import CurrentMap
from rackhand.schemas.moves import MoveEvent, PlannedPath, PlanningState
from rackhand.schemas.planar import yaw_quaternion
from rackhand.schemas.racks import DetectedRack, LoadReport, RackStates, SeenRacks
from rackhand.schemas.scan_points import ScanPairing, scan_points
from rackhand.services.viewer import colours
from rackhand.services.viewer.items import Drawing, Item, Level, Note, Pose, Row, told_frame
from rackhand.services.viewer.maps import map_drawings
from rackhand.services.viewer.racks import (
    Place,
    detected_drawings,
    load_drawings,
    outline_drawing,
    rack_points,
    seen_drawing,
    states_drawing,
)
from rackhand.services.viewer.shapes import curves, ink, line, name_tag, pen
from rackhand.services.viewer.trail import Trail

# Heights that keep flat things apart (m): a costmap over the map, lines over both. A 2-D scan has no height; its
# returns are drawn at about the height of a low chassis' lidar.
COSTMAP_Z, LINE_Z, SCAN_Z = 0.012, 0.03, 0.18
NAME_HEIGHT = 1.2
TRAIL_STEP, TRAIL_POINTS = 0.1, 500
SPEED_DIGITS = 4  # beyond them is the encoders' noise, which would fill the plot of a robot at rest


class ChassisView:
    """Keeps what the next message is drawn with: recent poses, the trail, the last logged states."""

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self._pairing = ScanPairing()
        self._trail = Trail(TRAIL_STEP, TRAIL_POINTS)
        self._status: ChassisStatus | None = None
        self._contacts: Contacts | None = None
        self._planning: PlanningState | None = None
        self._load: LoadReport | None = None
        self._rack_points: dict[str, Place] = {}
        self._rack_states: RackStates | None = None

    @property
    def frame(self) -> str:
        """The frame of the localised pose."""
        return told_frame(self.robot, "localised")

    def _at(self, name: str) -> str:
        return f"{self.robot}/{name}"

    def begin(self) -> Iterable[Item]:
        """Static items: the name tag, the names of the curves."""
        yield Drawing(self._at("name"), (name_tag(self.robot, NAME_HEIGHT),), frame=self.frame, static=True)
        for entity, name, colour in _CURVES:
            yield curves(self._at(entity), [name], [colour])

    # -- body and pose -----------------------------------------------------------------------------------------------

    def model(self, model: ChassisModel) -> Iterable[Item]:
        """The footprint with the wheels, at the localised pose."""
        strips = [*prism(model.footprint, model.height), *wheels(model)]
        lines = rr.LineStrips3D(strips, colors=ink(colours.FOOTPRINT), radii=pen(1.2))
        yield Drawing(self._at("footprint"), (lines,), frame=self.frame, static=True)

    def pose(self, message: LocalisedPose) -> Iterable[Item]:
        yield from self.place(message.pose)
        yield from self._matched(self._pairing.add_pose(message))

    def place(self, pose: Pose2) -> Iterable[Item]:
        """The chassis at a pose in the map, with the trail that leads there."""
        yield Pose(self.frame, (pose.x, pose.y, 0.0), yaw_quaternion(pose.yaw))
        if self._trail.add((pose.x, pose.y, LINE_Z)):
            yield Drawing(self._at("trail"), (line(self._trail.points, colours.TRAIL, 2.0),), lasting=True)

    def scan(self, scan: Scan) -> Iterable[Item]:
        """Drawn as soon as the pose at which it was taken is known."""
        yield from self._matched(self._pairing.add_scan(scan))

    def _matched(self, pair: tuple[Scan, Pose2] | None) -> Iterable[Item]:
        if pair is not None:
            hits = scan_points(*pair)
            points = np.column_stack([hits, np.full(len(hits), SCAN_Z)])
            yield Drawing(self._at("scan"), (rr.Points3D(points, colors=ink(colours.SCAN), radii=pen(1.8)),))

    # -- measurements ------------------------------------------------------------------------------------------------

    def odometry(self, odometry: Odometry) -> Iterable[Item]:
        yield from self.measured(odometry.twist)

    def measured(self, twist: Twist2) -> Iterable[Item]:
        yield Row(self._at("speed/forward"), (round(twist.linear, SPEED_DIGITS),))
        yield Row(self._at("speed/turning"), (round(twist.angular, SPEED_DIGITS),))

    def command(self, command: ChassisCommand) -> Iterable[Item]:
        yield from self.commanded(command.twist)

    def commanded(self, twist: Twist2) -> Iterable[Item]:
        yield Row(self._at("speed/forward_wanted"), (twist.linear,))
        yield Row(self._at("speed/turning_wanted"), (twist.angular,))

    def jack(self, jack: Jack) -> Iterable[Item]:
        yield Row(self._at("charge/jack"), (100 * jack.progress,))

    def battery(self, battery: Battery) -> Iterable[Item]:
        yield Row(self._at("charge/battery"), (100 * battery.percentage,))

    def contacts(self, contacts: Contacts) -> Iterable[Item]:
        before, self._contacts = self._contacts, contacts
        for name, closed in contacts.model_dump(exclude={"stamp"}).items():
            if closed != (before is not None and getattr(before, name)):
                yield self._note(
                    f"{name.replace('_', ' ')}: {'closed' if closed else 'open'}", _SWITCH_LEVELS.get(name)
                )

    # -- messages of the planner -------------------------------------------------------------------------------------

    def map(self, message: CurrentMap) -> Iterable[Item]:
        yield from map_drawings(self.robot, message.map)
        self._rack_points = rack_points(message.map)
        yield states_drawing(self.robot, self._rack_points, self._rack_states)
        yield self._note(f"map {message.map.map_name!r}" if message.map is not None else "no map")

    def outline(self, footprint: ChassisFootprint) -> Iterable[Item]:
        """The footprint in force, which grows with a load."""
        yield outline_drawing(self.robot, self.frame, footprint.outline)

    def load(self, load: LoadReport) -> Iterable[Item]:
        before, self._load = self._load, load
        yield from load_drawings(self.robot, self.frame, load)
        if before is None or before.state != load.state:
            yield self._note(f"load: {load.state.replace('_', ' ')}")

    def detected_rack(self, found: DetectedRack) -> Iterable[Item]:
        yield from detected_drawings(self.robot, found)

    def seen_racks(self, seen: SeenRacks) -> Iterable[Item]:
        yield seen_drawing(self.robot, seen)

    def rack_states(self, states: RackStates) -> Iterable[Item]:
        self._rack_states = states
        yield states_drawing(self.robot, self._rack_points, states)

    def costmap(self, costmap: Costmap) -> Iterable[Item]:
        rows = costmap.cost.reshape(-1, costmap.columns)
        grid = rr.GridMap(
            data=np.flipud(rows).tobytes(),
            format=rr.components.ImageFormat(
                width=rows.shape[1], height=rows.shape[0], color_model="L", channel_datatype="U8"
            ),
            cell_size=costmap.resolution,
            translation=(*costmap.origin, COSTMAP_Z),
            opacity=0.5,
            colormap=rr.components.Colormap.RvizCostmap,
        )
        yield Drawing(self._at("costmap"), (grid,), lasting=True)

    def path(self, path: PlannedPath) -> Iterable[Item]:
        yield Drawing(self._at("path"), (line(_flat(path.poses), colours.PATH, 3.0),), lasting=True)

    def planning_state(self, state: PlanningState) -> Iterable[Item]:
        before, self._planning = self._planning, state
        if before is None or _target(state) != _target(before):
            yield Drawing(self._at("target"), (target_arrow(_target(state)),), lasting=True)
        yield Row(self._at("distance/remaining"), (state.remaining_distance,))
        shown = (state.action_id, state.move_state)
        if state.action_id and (before is None or shown != (before.action_id, before.move_state)):
            # Rerun's font has no Chinese, of which the strings of REST are half.
            reason = f": {MoveFailReason(state.fail_reason).doc_name}" if state.fail_reason else ""
            text = f"move {state.action_id} ({state.action_type}) {state.move_state}{reason}"
            yield self._note(text, "WARN" if state.move_state == "failed" else None)
        if before is not None and state.stuck_state not in ("none", before.stuck_state):
            yield self._note(state.stuck_state.replace("_", " "), "WARN")

    def event(self, event: MoveEvent) -> Iterable[Item]:
        level: Level = "WARN" if event.event in ("failed", "blocked") else "INFO"
        yield self._note(f"move {event.move_id} {event.event}{f': {event.text}' if event.text else ''}", level)

    def status(self, status: ChassisStatus) -> Iterable[Item]:
        before, self._status = self._status or ChassisStatus(stamp=0), status
        if status.control_mode != before.control_mode:
            yield self._note(f"control mode {status.control_mode}")
        if status.emergency_stop != before.emergency_stop:
            said = "emergency stop" if status.emergency_stop else "emergency stop released"
            yield self._note(said, "ERROR" if status.emergency_stop else None)
        if status.driver_alive != before.driver_alive and before.stamp:  # at the start it is not up yet
            yield self._note(
                f"driver {'back' if status.driver_alive else 'lost'}", None if status.driver_alive else "ERROR"
            )
        known = {alert.code for alert in before.alerts}
        for alert in status.alerts:
            if alert.code not in known:
                yield self._note(f"alert {alert.code}: {alert.msg}", "ERROR" if alert.level == "error" else "WARN")

    def _note(self, text: str, level: Level | None = None) -> Note:
        return Note(self._at("log"), text, level or "INFO")


_CURVES = (
    ("speed/forward", "forward, m/s", colours.FIRST),
    ("speed/forward_wanted", "forward commanded, m/s", colours.SECOND),
    ("speed/turning", "turning, rad/s", colours.THIRD),
    ("speed/turning_wanted", "turning commanded, rad/s", colours.FOURTH),
    ("charge/battery", "battery, %", colours.FIRST),
    ("charge/jack", "jack, % of its stroke", colours.SECOND),
    ("distance/remaining", "remaining distance, m", colours.THIRD),
)
_SWITCH_LEVELS: dict[str, Level] = {"emergency_stop_button": "ERROR", "bumper_front": "WARN", "bumper_rear": "WARN"}


def prism(outline: NDArray[np.float64], height: float) -> list[NDArray[np.float64]]:
    """The edges of a polygon (n, 2) extruded from the floor to ``height``."""
    closed = np.vstack([outline, outline[:1]])
    low, high = (np.column_stack([closed, np.full(len(closed), z)]) for z in (0.005, height))
    return [low, high, *(np.array([a, b]) for a, b in zip(low[:-1], high[:-1], strict=True))]


def wheels(model: ChassisModel) -> list[NDArray[np.float64]]:
    """A circle for each driven wheel, standing on the floor."""
    angle = np.linspace(0.0, math.tau, 25)
    x, z = model.wheel_radius * np.cos(angle), model.wheel_radius * (1 + np.sin(angle))
    return [np.column_stack([x, np.full(len(x), side * model.wheel_separation / 2), z]) for side in (1, -1)]


def _target(state: PlanningState) -> Pose2 | None:
    return state.target if state.move_state == "moving" else None


def target_arrow(target: Pose2 | None) -> rr.Arrows3D:
    """From the target place, along the target heading."""
    if target is None:
        return rr.Arrows3D(vectors=[])
    length = 0.6
    return rr.Arrows3D(
        origins=[(target.x, target.y, LINE_Z)],
        vectors=[(length * math.cos(target.yaw), length * math.sin(target.yaw), 0.0)],
        colors=ink(colours.TARGET),
        radii=0.04,
    )


def _flat(poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) points just over the floor, of rows x, y, yaw."""
    return np.column_stack([poses[:, :2], np.full(len(poses), LINE_Z)])
