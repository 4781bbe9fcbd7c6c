"""A motion that is under way: sampled at any time, stopped along its path, slowed, resumed, extended.

A ``Motion`` is a value. Every change makes a new one that takes over from the old at the time of the change: the
planned time law is cut there and continues differently, and as the filter runs over both parts alike, q, dq and ddq
stay continuous. Times are seconds on the caller's axis and belong to the commanded motion.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.continuation import Continuation, follow
from rackhand.services.controller.trajectory.curve import JointCurve
from rackhand.services.controller.trajectory.geometry import JointPath, TaskPath, TaskState
from rackhand.services.controller.trajectory.model import JointLimits, Kinematics, TaskLimits
from rackhand.services.controller.trajectory.time_law import TimeLaw, at_rest
from rackhand.services.controller.trajectory.timing import PathConstraints, Planning, Timed, brake, plan, rows


@dataclass(frozen=True)
class PathLimits:
    """What a path is timed with. ``task`` None leaves the TCP free."""

    joints: JointLimits
    task: TaskLimits | None = None


@dataclass(frozen=True)
class Sample:
    """The reference at one time: joints (n,), and on a task path the TCP, each with two derivatives."""

    q: Array
    dq: Array
    ddq: Array
    task: TaskState | None
    s: float
    done: bool


@dataclass(frozen=True)
class Motion:
    """``curve`` q(s) of ``path``, ``rows`` its limits along s, and ``law``, s(t) before the filter.

    ``use``: how much of velocity, acceleration and jerk limits the last plan uses at worst (1 = all).
    """

    path: JointPath | TaskPath
    curve: JointCurve
    rows: PathConstraints
    law: TimeLaw
    planning: Planning
    rate: float = 1.0
    use: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def end(self) -> float:
        """When it is at rest, as planned now."""
        return self.law.end + self.planning.smoothing.total

    @property
    def rest(self) -> Array:
        """The joint positions (n,) in which it comes to rest, as planned now."""
        return np.asarray(self.curve.derivatives(self.law.s[-1:], left=True)[0, 0])

    def at(self, t: float) -> Sample:
        s, v, a, _ = self.law.filtered(np.array([t]), self.planning.smoothing)[0]
        q, first, second, _ = self.curve.derivatives(np.array([s]))[:, 0]
        task = None
        if isinstance(self.path, TaskPath):
            state = self.path.at(float(s))
            task = TaskState(state.pose, state.twist * v, state.accel * v * v + state.twist * a)
        return Sample(q, first * v, second * v * v + first * a, task, float(s), t >= self.end)

    def braked(self, t: float) -> Motion:
        """From ``t`` on to rest along the path, as fast as the limits allow. The rest of the path stays known."""
        stopped = self.driven(brake(self.curve, self.rows, self.planning, self.until(t)))
        # Near the end what is planned may already be the sooner stop.
        return stopped if stopped.end < self.end else self

    def scaled(self, t: float, rate: float) -> Motion:
        """From ``t`` on with velocity limits times ``rate`` in (0, 1]; continues after ``braked`` too."""
        if not 0 < rate <= 1:
            raise ValueError(f"the rate is in (0, 1], not {rate}")
        return replace(self.driven(plan(self.curve, self.rows, self.planning, self.until(t), rate)), rate=rate)

    def resumed(self, t: float) -> Motion:
        """From ``t`` on to the end of the path."""
        return self.scaled(t, self.rate)

    def shifted(self, by: float) -> Motion:
        """The same, ``by`` seconds later."""
        return replace(self, law=replace(self.law, t=self.law.t + by))

    def until(self, t: float) -> TimeLaw:
        """What is driven before ``t``, as far back as the filter still sees it."""
        return self.law.cut(t, self.planning.smoothing.total)

    def driven(self, timed: Timed) -> Motion:
        """The same path with another law."""
        return replace(self, law=timed.law, use=timed.use)


def start_joints(
    t: float, path: JointPath, limits: PathLimits, planning: Planning, kinematics: Kinematics | None = None
) -> Motion:
    """A motion along a joint path, at rest at ``t``. ``kinematics`` is needed with task limits only."""
    return _start(t, path, path.curve(), limits, planning, kinematics)


def start_task(
    t: float,
    path: TaskPath,
    q: Array,
    limits: PathLimits,
    planning: Planning,
    kinematics: Kinematics,
    options: Continuation | None = None,
) -> Motion:
    """A motion along a task path, at rest at ``t`` in ``q``. Raises ``PathRefused`` (waypoints numbered from 0 without
    the path's first)."""
    return _start(t, path, follow(kinematics, limits.joints, path, q, options=options), limits, planning, kinematics)


def _start(
    t: float,
    path: JointPath | TaskPath,
    curve: JointCurve,
    limits: PathLimits,
    planning: Planning,
    kinematics: Kinematics | None,
) -> Motion:
    lines = rows(curve, limits.joints, planning, limits.task, path if isinstance(path, TaskPath) else None, kinematics)
    timed = plan(curve, lines, planning, at_rest(t, curve.start))
    return Motion(path, curve, lines, timed.law, planning, use=timed.use)
