"""An arm: its tool, its path, tracking errors, who holds control."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import rerun as rr

from rackhand.schemas.base import Quaternion, Vec3
from rackhand.schemas.crf_contact import Contact
from rackhand.schemas.motion import (
    ArmModel,
    Gripper,
    Holder,
    MotionDiagnostics,
    MotionEvent,
    MotionPath,
    MotionStatus,
)
from rackhand.schemas.orientation import TaskPose, quaternion
from rackhand.services.viewer import colours
from rackhand.services.viewer.items import Drawing, Item, Level, Note, Pose, Row, told_frame
from rackhand.services.viewer.shapes import curves, ink, line, name_tag, pen
from rackhand.services.viewer.trail import Trail

TRAIL_STEP, TRAIL_POINTS = 0.01, 400
NAME_HEIGHT = -0.3  # m over the base: on the pedestal
_AXES = {"mount": 0.15, "tool": 0.12, "target": 0.08}  # frame → length of its axes, m
_CURVES = (
    ("error/linear", "tool off its target, mm", colours.FIRST),
    ("error/angular", "tool off its target, mrad", colours.SECOND),
    ("loop/tick", "longest tick, µs", colours.FIRST),
    ("loop/solver", "longest solve, µs", colours.SECOND),
    ("counts/iterations", "solver iterations", colours.FIRST),
    ("counts/late_ticks", "late ticks", colours.FOURTH),
)
_EVENTS: dict[str, str] = {
    "controlGranted": "control granted to",
    "controlLost": "control lost by",
    "stopped": "stopped, by",
    "resumed": "resumed, by",
    "heartbeatLost": "heartbeat lost of",
}
_LEVELS: dict[str, Level] = {"controlLost": "WARN", "stopped": "ERROR", "heartbeatLost": "WARN", "contact": "WARN"}


@dataclass(frozen=True)
class ArmMount:
    """Where an arm's base is in the map, and where its tool was first, in the frame of the base."""

    position: Vec3 = (0.0, 0.0, 0.0)
    orientation: Quaternion = (1.0, 0.0, 0.0, 0.0)
    tool: Vec3 = (0.5, 0.0, 0.5)


class ArmView:
    """Keeps the tool's trail and the last logged states. Until its model arrives, it is drawn at the map's origin."""

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self._trail = Trail(TRAIL_STEP, TRAIL_POINTS)
        self._status: MotionStatus | None = None
        self.mount = ArmMount()

    def _at(self, name: str) -> str:
        return f"{self.robot}/{name}"

    def _frame(self, name: str) -> str:
        return told_frame(self.robot, name)

    def begin(self) -> Iterable[Item]:
        """Static items: axes of the arm's frames, and the names of its curves."""
        yield Drawing(self._at("name"), (name_tag(self.robot, NAME_HEIGHT),), frame=self._frame("mount"), static=True)
        for name, length in _AXES.items():
            yield Drawing(
                self._at(f"frames/{name}"), (rr.TransformAxes3D(length),), frame=self._frame(name), static=True
            )
        for entity, name, colour in _CURVES:
            yield curves(self._at(entity), [name], [colour])
        for entity, unit in (("position", "rad"), ("velocity", "rad/s"), ("error", "rad")):
            names = [f"joint {number}, {unit}" for number in range(1, len(colours.SERIES) + 1)]
            yield curves(self._at(f"joints/{entity}"), names, colours.SERIES)

    def model(self, model: ArmModel) -> Iterable[Item]:
        self.mount = replace(self.mount, position=model.position, orientation=model.orientation)
        yield Pose(self._frame("mount"), model.position, model.orientation)

    def status(self, status: MotionStatus) -> Iterable[Item]:
        before, self._status = self._status, status
        for name, expected in (("position", status.joint_positions), ("velocity", status.joint_velocities)):
            if expected.value is not None and all(map(math.isfinite, expected.value)):
                yield Row(self._at(f"joints/{name}"), expected.value)
        if status.task_pose.value is not None and status.task_pose.value.finite:
            yield from self._tool(status.task_pose.value)
        yield from self._said(before, status)

    def _tool(self, pose: TaskPose) -> Iterable[Item]:
        position: Vec3 = pose.position
        if not len(self._trail):
            self.mount = replace(self.mount, tool=position)
        yield Pose(self._frame("tool"), position, quaternion(pose.orientation.rotation()), parent=self._frame("mount"))
        if self._trail.add(position):
            trail = line(self._trail.points, colours.TRAIL, 2.0)
            yield Drawing(self._at("trail"), (trail,), frame=self._frame("mount"), lasting=True)

    def _said(self, before: MotionStatus | None, status: MotionStatus) -> Iterable[Note]:
        held, was_held = _holder(status.holder), _holder(before.holder if before is not None else None)
        if held != was_held:
            yield self._note(f"locked by {held}" if held else "unlocked")
        runs = bool(status.is_trajectory_running.value)
        if runs != (before is not None and bool(before.is_trajectory_running.value)):
            yield self._note("a trajectory runs" if runs else "the trajectory is done")
        grip, grip_before = _gripper(status.gripper), _gripper(before.gripper if before is not None else None)
        if grip != grip_before:
            yield self._note(grip)
        if status.stopped_by and (before is None or status.stopped_by != before.stopped_by):
            yield self._note(f"stopped by {_short(status.stopped_by)}", "ERROR")

    def diagnostics(self, message: MotionDiagnostics) -> Iterable[Item]:
        yield Pose(
            self._frame("target"), message.target_position, message.target_orientation, parent=self._frame("mount")
        )
        yield Row(self._at("joints/error"), message.joint_errors)
        yield Row(self._at("error/linear"), (1e3 * message.linear_error,))
        yield Row(self._at("error/angular"), (1e3 * message.angular_error,))
        yield Row(self._at("loop/tick"), (message.tick_us,))
        yield Row(self._at("loop/solver"), (message.solver_us,))
        yield Row(self._at("counts/iterations"), (float(message.solver_iterations),))
        yield Row(self._at("counts/late_ticks"), (float(message.late_ticks),))

    def path(self, path: MotionPath) -> Iterable[Item]:
        ends = path.points[[end for end in path.ends if end < len(path.points)]]
        yield Drawing(
            self._at("path"), (line(path.points, colours.PATH, 3.0),), frame=self._frame("mount"), lasting=True
        )
        marks = rr.Points3D(ends, colors=ink(colours.TARGET), radii=pen(5.0))
        yield Drawing(self._at("way_points"), (marks,), frame=self._frame("mount"), lasting=True)

    def event(self, event: MotionEvent) -> Iterable[Item]:
        info = event.info
        if isinstance(info, Contact):
            at = "at the flange" if info.joint is None else f"of joint {info.joint}"
            done = "stopped by contact" if info.stopped else "contact"
            yield self._note(f"{done}: {info.kind} {at} {info.value:.3g} {info.unit}", _LEVELS["contact"])
            return
        text = f"{_EVENTS[event.name]} {_short(info.client)} (priority {info.priority})"
        if info.kind:
            text = f"{info.kind}: {text}"
        if info.reason:
            text += f": {info.reason}" + (f" by {_short(info.by)}" if info.by else "")
        yield self._note(text, _LEVELS.get(event.name))

    def _note(self, text: str, level: Level | None = None) -> Note:
        return Note(self._at("log"), text, level or "INFO")


def _holder(holder: Holder | None) -> str:
    return f"{_short(holder.client)} at priority {holder.priority}" if holder is not None else ""


def _gripper(gripper: Gripper | None) -> str:
    if gripper is None or not gripper.suction:
        return "suction off"
    return "suction on, holding an object" if gripper.holding else "suction on, holding nothing"


def _short(client: str) -> str:
    """Clients without a name of their own have a long one."""
    return client if len(client) <= 16 else f"{client[:12]}…"
