"""What CRF's path commands mean (spec motion-controller §6.3, §6.6), as a value: every command makes a new queue.

A command that is refused raises ``PathRefused`` and changes nothing. Waypoints of the kind that is being driven are
appended without a stop; another kind stops softly, drops what was queued, and is driven from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.continuation import Continuation, pose_error
from rackhand.services.controller.trajectory.geometry import (
    JointPath,
    TaskPath,
    Tolerance,
    joint_path,
    pose_step,
    step_length,
    task_path,
)
from rackhand.services.controller.trajectory.joint_stop import JointStop, stop_joints
from rackhand.services.controller.trajectory.model import Kinematics, PathCheck, PathRefused, Placement, TcpPose
from rackhand.services.controller.trajectory.simplify import Resolution, kept_joints, kept_poses
from rackhand.services.controller.trajectory.splice import extend_joints, extend_task
from rackhand.services.controller.trajectory.stream import Motion, PathLimits, Sample, start_joints, start_task
from rackhand.services.controller.trajectory.timing import Planning

_DUPLICATE = 1e-7
_SHORTEST = 5e-6
"""m, a radian counting as ``ANGLE_LENGTH`` metres: a shorter task path is below the accuracy it is followed with."""
_REACHED = 1e-4


class Method(IntEnum):
    """How task waypoints are driven: ``TrajectoryExecutionMethod`` of CRF."""

    JOINT_SPACE = 1
    TASK_SPACE = 2


class ReferenceFrame(IntEnum):
    """What task waypoints refer to: ``PointReferenceFrame`` of CRF. TCP means its pose when the command is given."""

    BASE = 1
    TCP = 2


@dataclass(frozen=True)
class PathArm:
    """The arm as the queue needs it. ``joints`` times joint-space motion, ``task`` what follows task paths; changes
    hold for what is appended afterwards."""

    kinematics: Kinematics
    joints: PathLimits
    task: PathLimits
    planning: Planning = field(default_factory=Planning)
    tolerance: Tolerance = field(default_factory=Tolerance)
    options: Continuation = field(default_factory=Continuation)
    resolution: Resolution = field(default_factory=Resolution)
    check: PathCheck | None = None


@dataclass(frozen=True)
class QueuedMotion:
    """A motion in the queue, from ``begin`` on. ``kind`` is what CRF calls its type, "joints" or "task"."""

    motion: Motion | JointStop
    begin: float
    kind: str
    stopped: bool = False


@dataclass(frozen=True)
class MotionQueue:
    """Motions one after the other, each planned to begin where and when the one before it ends.

    ``rest`` (n,) is the position of the arm without any. While ``paused``, the first is held at rest and the others
    wait. Times are seconds and only go forward from call to call.
    """

    arm: PathArm
    rest: Array
    motions: tuple[QueuedMotion, ...] = ()
    paused: bool = False

    # -- what is driven ---------------------------------------------------------------------------------------------

    def at(self, t: float) -> Sample:
        """The reference at ``t``."""
        for queued in reversed(self.motions[:1] if self.paused else self.motions):
            if queued.begin <= t or queued is self.motions[0]:
                return queued.motion.at(t)
        still = np.zeros_like(self.rest)
        return Sample(self.rest, still, still, None, 0.0, True)

    def running(self, t: float) -> bool:
        """Whether anything moves, or will without another command."""
        return bool(self.motions) and t < self.motions[0 if self.paused else -1].motion.end

    # -- commands ---------------------------------------------------------------------------------------------------

    def append_joints(self, t: float, points: Sequence[Array]) -> MotionQueue:
        """Joint waypoints, (n,) each, rad. Points that repeat the one before them are left out."""
        for i, point in enumerate(points):
            self._check(i, np.asarray(point, float))
        return self._for(t, "joints")._add_joints(t, "joints", [np.asarray(point, float) for point in points])

    def append_task(
        self,
        t: float,
        points: Sequence[Placement],
        method: Method,
        reference: ReferenceFrame,
        tcp: Placement | None = None,
    ) -> MotionQueue:
        """Task waypoints. ``tcp`` is where the TCP is now, for ``ReferenceFrame.TCP``; default: as it is commanded."""
        if reference == ReferenceFrame.TCP:
            now = tcp or self.arm.kinematics.forward(self.at(t).q)
            points = [TcpPose(now.translation, now.rotation) @ point for point in points]
        for i, point in enumerate(points):
            if not (np.isfinite(point.translation).all() and np.isfinite(point.rotation).all()):
                raise PathRefused(i, "the pose is not finite")
        queue = self._for(t, "task")
        poses, kept = _distinct_poses(self.arm.kinematics.forward(queue._end()), points)
        if not kept:
            raise PathRefused(
                0, f"no motion: all waypoints are within {1e6 * _SHORTEST:g} µm of the end of the previous path"
            )
        try:
            if method == Method.JOINT_SPACE:
                return queue._add_joints(t, "task", queue._solve(poses[1:]))
            needed = kept_poses(poses, self.arm.resolution)
            kept = [kept[k - 1] for k in needed[1:]]
            return queue._add_task(t, [poses[k] for k in needed])
        except PathRefused as refused:
            raise PathRefused(kept[min(refused.point, len(kept) - 1)], refused.reason) from None

    def soft_stop(self, t: float) -> MotionQueue:
        """Stops along the path and drops the rest of it."""
        motions = self._alive(t)
        return self._only(t, replace(_braked(motions[0], t), stopped=True) if motions else None)

    def hard_stop(self, t: float) -> MotionQueue:
        """Stops every joint as fast as it can, off the path if need be, and drops the rest."""
        motions = self._alive(t)
        if not motions or isinstance(motions[0].motion, JointStop):
            return self._only(t, motions[0] if motions else None)
        stop = stop_joints(t, self.at(t), self.arm.joints.joints)
        return self._only(t, QueuedMotion(stop, t, motions[0].kind, stopped=True))

    def pause(self, t: float) -> MotionQueue:
        """Stops along the path; ``resume`` continues it and all that is queued."""
        motions = self._alive(t)
        if not motions or self.paused:
            return self
        return replace(self, motions=(_braked(motions[0], t), *motions[1:]), paused=True)

    def resume(self, t: float) -> MotionQueue:
        if not self.paused:
            return self
        first = self.motions[0]
        if isinstance(first.motion, Motion) and not first.stopped:
            first = replace(first, motion=first.motion.resumed(t))
        return _sequenced(replace(self, motions=(first, *self.motions[1:]), paused=False), t)

    # -- how --------------------------------------------------------------------------------------------------------

    def _for(self, t: float, kind: str) -> MotionQueue:
        """This queue, stopped if it drives another kind."""
        if not self._alive(t):
            return self._only(t, None)
        return self if self.motions[-1].kind == kind else self.soft_stop(t)

    def _add_joints(self, t: float, kind: str, points: Sequence[Array]) -> MotionQueue:
        distinct, numbers = [self._end()], [-1]
        for i, point in enumerate(points):
            if np.abs(point - distinct[-1]).max() > _DUPLICATE:
                distinct.append(point)
                numbers.append(i)
        if len(distinct) == 1:
            return self
        arm, last = self.arm, self._open(kind, JointPath)
        needed = kept_joints(np.array(distinct), arm.resolution)
        path = joint_path(np.array(distinct)[needed], arm.tolerance, last.curve.end if last else 0.0)
        if last:
            motion = extend_joints(last, self._from(t), path, arm.tolerance, arm.joints, arm.kinematics)
        else:
            motion = start_joints(self._next(t), path, arm.joints, arm.planning, arm.kinematics)
        try:
            _require_clear(motion, path.legs.s, arm.check)
        except PathRefused as refused:
            raise PathRefused(numbers[needed[refused.point + 1]], refused.reason) from None
        return self._with_last(t, motion) if last else self._added(t, motion, self._next(t), kind)

    def _add_task(self, t: float, poses: Sequence[TcpPose]) -> MotionQueue:
        arm, last = self.arm, self._open("task", TaskPath)
        path = task_path(poses, arm.tolerance, last.curve.end if last else 0.0)
        if last:
            when = self._from(t)
            longer = extend_task(last, when, path, arm.tolerance, arm.task, arm.kinematics, arm.options)
            _require_clear(longer, path.legs.s, arm.check)
            return self._with_last(t, longer)
        begin = self._next(t)
        motion = start_task(begin, path, self._end(), arm.task, arm.planning, arm.kinematics, arm.options)
        _require_clear(motion, path.legs.s, arm.check)
        return self._added(t, motion, begin, "task")

    def _solve(self, poses: Sequence[Placement]) -> list[Array]:
        """Joint positions for poses, each near the one before."""
        solved: list[Array] = []
        near = self._end()
        for i, pose in enumerate(poses):
            q = self.arm.kinematics.solve(pose, near)
            if q is None:
                raise PathRefused(i, "no joint positions within the limits reach this pose")
            self._check(i, q)
            missed = pose_error(self.arm.kinematics.forward(q), pose)
            if np.abs(missed).max() > _REACHED:
                far, turned = 1e3 * np.linalg.norm(missed[:3]), np.degrees(np.linalg.norm(missed[3:]))
                away = f"{far:.1f} mm and {turned:.2f}° away"
                raise PathRefused(i, f"out of reach: the nearest reachable pose is {away}")
            solved.append(q)
            near = q
        return solved

    def _check(self, i: int, q: Array) -> None:
        if q.shape != self.rest.shape:
            raise PathRefused(i, f"{q.size} numbers for {self.rest.size} joints")
        if not np.isfinite(q).all():
            raise PathRefused(i, "the joint positions are not finite")
        outside = self.arm.joints.joints.outside(q)
        if outside is not None:
            raise PathRefused(i, outside)

    def _alive(self, t: float) -> tuple[QueuedMotion, ...]:
        """The motions that have not ended; the first of them is under way."""
        return self.motions if self.paused else tuple(queued for queued in self.motions if t < queued.motion.end)

    def _open(self, kind: str, path: type) -> Motion | None:
        """The last motion, if waypoints of that sort can be appended to it."""
        if not self.motions or self.motions[-1].stopped or self.motions[-1].kind != kind:
            return None
        motion = self.motions[-1].motion
        return motion if isinstance(motion, Motion) and isinstance(motion.path, path) else None

    def _end(self) -> Array:
        """Where all that is queued ends."""
        if not self.motions:
            return self.rest
        last = self.motions[-1]
        return last.motion.curve.q[-1] if isinstance(last.motion, Motion) and not last.stopped else last.motion.rest

    def _next(self, t: float) -> float:
        return max(t, self.motions[-1].motion.end) if self.motions else t

    def _from(self, t: float) -> float:
        """From when on the last motion can still be changed. One that waits behind a pause is at its beginning."""
        waits = self.paused and len(self.motions) > 1
        return self.motions[-1].begin if waits else max(t, self.motions[-1].begin)

    def _only(self, t: float, queued: QueuedMotion | None) -> MotionQueue:
        rest = self.at(t).q if queued is None else queued.motion.rest
        return replace(self, motions=() if queued is None else (queued,), rest=rest, paused=False)

    def _added(self, t: float, motion: Motion, begin: float, kind: str) -> MotionQueue:
        return replace(self, motions=(*self._alive(t), QueuedMotion(motion, begin, kind)))

    def _with_last(self, t: float, motion: Motion) -> MotionQueue:
        last = replace(self.motions[-1], motion=motion)
        if self.paused and len(self.motions) == 1:
            last = _braked(last, t)
        return replace(self, motions=(*self._alive(t)[:-1], last))


def _require_clear(motion: Motion, waypoints: Array, check: PathCheck | None) -> None:
    """Raises ``PathRefused`` where ``motion`` may not be driven from the corner at ``waypoints``[0] on, (k,) values of
    s, which the refusal counts from 0 for the one after it."""
    if check is None:
        return
    legs = motion.path.legs
    corner = int(np.argmin(np.abs(legs.s - waypoints[0])))
    found = check.conflict(motion.curve, max(float(legs.s[corner] - legs.radius[corner]), motion.curve.start))
    if found is not None:
        s, why = found
        unit = "m" if isinstance(motion.path, TaskPath) else "rad"
        point = min(max(int(np.searchsorted(waypoints, s - 1e-9)), 1), waypoints.size - 1) - 1
        raise PathRefused(point, f"{waypoints[point + 1] - s:.3f} {unit} before this point {why}")


def _braked(queued: QueuedMotion, t: float) -> QueuedMotion:
    """The motion, stopping along its path unless it is stopping already."""
    return (
        replace(queued, motion=queued.motion.braked(t))
        if isinstance(queued.motion, Motion) and not queued.stopped
        else queued
    )


def _sequenced(queue: MotionQueue, t: float) -> MotionQueue:
    """Every motion after the first begins when the one before it ends, and not before ``t``."""
    motions = list(queue.motions[:1])
    for queued in queue.motions[1:]:
        begin = max(t, motions[-1].motion.end)
        motion = queued.motion.shifted(begin - queued.begin) if isinstance(queued.motion, Motion) else queued.motion
        motions.append(replace(queued, motion=motion, begin=begin))
    return replace(queue, motions=tuple(motions))


def _distinct_poses(start: Placement, points: Sequence[Placement]) -> tuple[list[TcpPose], list[int]]:
    """``start`` and the poses that are not where the one before them is; and which of the points these were."""
    poses, kept = [TcpPose(start.translation, start.rotation)], []
    for i, point in enumerate(points):
        if step_length(pose_step(poses[-1], point)[None])[0] > _SHORTEST:
            poses.append(TcpPose(np.asarray(point.translation, float), np.asarray(point.rotation, float)))
            kept.append(i)
    return poses, kept
