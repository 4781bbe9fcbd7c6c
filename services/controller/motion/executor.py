"""What the joints are told at each tick: along the queued paths, at a velocity, with a torque, or to a stop.

Paths are the resting state: an idle arm is an empty queue. A velocity or torque reference begins from there and ends
there; whatever must end while it moves becomes a queue of one stop, so that what follows can be planned at once.
Times are seconds of the arm's clock. ``q``, ``v``, ``a`` are commanded and belong to ``time``, the end of the period
that the last command was for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import ArmState
from rackhand.services.controller import ik
from rackhand.services.controller.ik import kernels
from rackhand.services.controller.motion.kinematics import ArmKinematics
from rackhand.services.controller.motion.meter import Meter, Stopwatch, no_stopwatch
from rackhand.services.controller.motion.parameters import Tuning
from rackhand.services.controller.motion.profile import Profile, hardware_limits, path_arm
from rackhand.services.controller.motion.ramp import Ramp
from rackhand.services.controller.trajectory.continuation import pose_error
from rackhand.services.controller.trajectory.geometry import TaskPath
from rackhand.services.controller.trajectory.joint_stop import stop_joints
from rackhand.services.controller.trajectory.model import Array, Pose
from rackhand.services.controller.trajectory.queue import MotionQueue, QueuedMotion
from rackhand.services.controller.trajectory.stream import Motion, Sample

CommandMode = Literal["position", "velocity", "torque"]

AT_REST = 1e-6  # rad/s commanded
_TASK_JERK_TIME = 0.05  # seconds in which a task velocity's acceleration may build up
_MAX_TRACKING_LAG = np.array(
    [2e-4] * 3 + [1e-3] * 3
)  # m, rad: how far a tool that cannot follow stays behind its target
_STOP = "stop"


@dataclass(frozen=True)
class Reference:
    """``values``: joints (n,), or a twist or wrench (6,) at the tool in base axes."""

    signal: Literal["velocity", "torque"]
    space: Literal["joints", "task"]
    values: Array

    def continues_as(self, other: Reference) -> bool:
        return (self.signal, self.space) == (other.signal, other.space)


class MotionExecutor:
    """One arm's motion. See the module."""

    def __init__(self, arm: ik.Arm, period: float, stopwatch: Stopwatch = no_stopwatch) -> None:
        self.arm, self.period = arm, period
        self.kinematics = ArmKinematics(arm)
        self.solver = ik.DifferentialIk(arm, period)
        self.solver_meter, self.solver_iterations = Meter(stopwatch), 0  # the most since they were last read
        self.tuning = Tuning(self.solver)
        self.profile = Profile.default(arm)
        self.queue = MotionQueue(path_arm(arm, self.profile), arm.home)
        self.time = 0.0
        self.codes: frozenset[CrfCode] = frozenset()
        self._active: Reference | None = None  # what is followed; its values may have become zero
        self._wanted: Reference | None = None  # what is to be followed, once the arm stands
        self._ending: Literal["soft", "hard"] | None = None  # of a torque, at the next measurement
        self._ramp = Ramp(arm.n)
        self._target = ik.forward(arm, arm.home)  # of a task velocity
        self._by_solver = False
        self.q, self.v, self.a = arm.home.copy(), np.zeros(arm.n), np.zeros(arm.n)

    # -- what others ask ----------------------------------------------------------------------------------------------

    @property
    def standing(self) -> bool:
        """Nothing moves, nor will without another command. A paused queue stands too."""
        if self._active is not None or self._wanted is not None:
            return False
        return not self.queue.running(self.time) and bool(np.abs(self.v).max() <= AT_REST)

    @property
    def running(self) -> bool:
        """Whether a path is being driven."""
        return self._active is None and self.queue.running(self.time)

    @property
    def plannable(self) -> bool:
        """Whether way-points can be planned from where the queue ends. Not where the solver chooses the posture on
        the way, nor before a reference has ended."""
        return self._active is None and not (self._by_solver and self.queue.legs)

    @property
    def low_manipulability(self) -> bool:
        frames, columns = np.empty((self.arm.n + 1, 3, 4)), np.empty((6, self.arm.n))
        kernels.forward(self.arm.placements, self.q, frames)
        kernels.jacobian(frames, columns)
        return bool(kernels.manipulability(columns) < self.solver.settings.low_manipulability)

    def rotation(self) -> Array:
        """Of the tool as commanded, (3, 3)."""
        return self.kinematics.forward(self.q).rotation

    # -- commands -----------------------------------------------------------------------------------------------------

    def begin_at(self, state: ArmState, t: float) -> None:
        """The arm is heard for the first time: it is held where it is, or stopped if it moves."""
        self.time, self._wanted = t, None
        self._measured(state)
        self._brake(hard=False)

    def set_profile(self, profile: Profile) -> None:
        """For paths appended from now on."""
        self.profile = profile.bounded(self.arm)
        self.queue = replace(self.queue, arm=path_arm(self.arm, self.profile))

    def follow(self, reference: Reference) -> None:
        """A new velocity or torque: at once if one of its sort is followed, else when the arm has stopped softly."""
        active = self._active
        if (
            active is not None
            and self._ending is None
            and (active.signal, active.space) == (reference.signal, reference.space)
        ):
            self._active = reference
            return
        self.soft_stop()
        self._wanted = reference

    def silence(self) -> None:
        """The reference has died: a velocity ramps down to zero, a torque ends in a stop."""
        self._wanted = None
        if self._active is None:
            return
        if self._active.signal == "torque":
            self._end_reference(hard=False)
        else:
            self._active = replace(self._active, values=np.zeros_like(self._active.values))

    def soft_stop(self) -> None:
        """Along the path, within the profile's limits; the queue is dropped."""
        self._wanted = None
        if self._active is not None:
            self._end_reference(hard=False)
        else:
            self.queue = self.queue.soft_stop(self.time)

    def hard_stop(self) -> None:
        """Every joint as fast as the arm can."""
        self._wanted = None
        if self._active is not None:
            self._end_reference(hard=True)
        elif self.queue.running(self.time):
            self._brake(hard=True)
        else:
            self.queue = self.queue.soft_stop(self.time)

    def pause(self) -> None:
        """Stops as ``soft_stop`` does, and keeps the queue. Of a reference there is nothing to keep."""
        if self._active is not None or self._wanted is not None:
            self.soft_stop()
        else:
            self.queue = self.queue.pause(self.time)

    def resume(self) -> None:
        self.queue = self.queue.resume(self.time)

    def make_way(self, kind: Literal["joints", "task"]) -> None:
        """Before way-points of a kind are planned: ends what they cannot be appended to."""
        if self._active is not None or self._wanted is not None or (self._by_solver and kind == "joints"):
            self.soft_stop()

    def drive(self, queue: MotionQueue) -> None:
        """A queue that was planned from the present one."""
        if not self.queue.legs:
            tasks = all(isinstance(leg.motion, Motion) and isinstance(leg.motion.path, TaskPath) for leg in queue.legs)
            self._by_solver = self.tuning.shapes_paths and tasks
        self.queue = replace(queue, arm=self.queue.arm)

    # -- ticks --------------------------------------------------------------------------------------------------------

    def tick(self, t: float, state: ArmState) -> tuple[CommandMode, Sequence[float]]:
        """The command for the period that begins at ``t``, where ``state`` was measured."""
        if t > self.time + 0.5 * self.period:
            # Ticks were missed: what was commanded last has been reached and held.
            self.time = t
        if self._wanted is not None and self._active is None and not self.queue.running(self.time):
            self._begin_reference(self._wanted)
        codes: set[CrfCode] = set()
        mode: CommandMode = "position"
        values = self.q
        if self._active is not None and self._active.signal == "torque":
            torque = self._torque(self._active, state, codes)
            if torque is not None:
                mode, values = "torque", torque
        if mode == "position":
            self._step(codes)
            values = self.q
        self.time += self.period
        self.codes = frozenset(codes)
        return mode, values.tolist()

    def _step(self, codes: set[CrfCode]) -> None:
        if self._active is not None:
            self._velocity(self._active, codes)
        elif self.queue.legs:
            self._path(codes)

    def _path(self, codes: set[CrfCode]) -> None:
        ahead = self.time + self.period
        if self._by_solver:
            self._track(self.queue.at(self.time), codes)
        else:
            sample = self.queue.at(ahead)
            self.q, self.v, self.a = sample.q, sample.dq, sample.ddq
            if sample.task is not None and self.low_manipulability:
                codes.add(CrfCode.LowManipulability)
        if self.queue.running(ahead):
            return
        if np.abs(self.v).max() > AT_REST:
            # The solver has not quite arrived: what is left of its motion ends here.
            self.time += self.period
            self._brake(hard=False)
            self.time -= self.period
        elif not self.queue.paused:
            self.queue = replace(self.queue, legs=(), rest=self.q)
            self.v, self.a = np.zeros_like(self.v), np.zeros_like(self.a)

    def _track(self, sample: Sample, codes: set[CrfCode]) -> None:
        """One period by the solver, which may choose another posture than the plan's."""
        if sample.task is None:
            self._brake(hard=False)
            return
        pose, twist = sample.task.pose, sample.task.twist + 0.5 * self.period * sample.task.accel
        target = np.column_stack([pose.rotation, pose.translation])
        self._solve(target, twist, codes)

    def _velocity(self, active: Reference, codes: set[CrfCode]) -> None:
        over = not active.values.any()
        if active.space == "joints":
            acceleration = np.minimum(self.profile.joint_acceleration, self.arm.limits.acceleration)
            wish = self._ramp.step(active.values, acceleration, self.arm.limits.jerk, self.period)
            lower, upper = ik.velocity_box(self.arm, self.q, self.v, self.period)
            self._integrate(np.clip(wish, lower, upper))
            self._ramp.cut(self.v)
        else:
            acceleration = self.profile.task_acceleration
            wish = self._ramp.step(active.values, acceleration, acceleration / _TASK_JERK_TIME, self.period)
            wish = self._ramp.slow(self.solver.pace(self.q, self.v, wish))
            wish = self._ramp.slow(self._slack(wish))
            self._solve(self._target, wish, codes, held=True)
            self._target = _advanced(self._target, wish * self.period)
        if not (over and np.abs(wish).max() <= AT_REST):
            return
        if np.abs(self.v).max() <= AT_REST:
            # No stop: that would fade the ramp's last acceleration, and swing back by it.
            self._stand()
        else:
            self.time += self.period
            self._brake(hard=False)
            self.time -= self.period

    def _slack(self, twist: Array) -> float:
        """What part of ``twist`` the target may make, 0 … 1: less the farther behind the tool is. At limits and
        singularities the target waits, and turning back is followed at once."""
        target = Pose(self._target[:, 3], self._target[:, :3])
        behind = pose_error(self.kinematics.forward(self.q), target) / _MAX_TRACKING_LAG
        if behind @ (twist / _MAX_TRACKING_LAG) <= 0:
            return 1.0
        return max(0.0, 1.0 - float(np.linalg.norm(behind)))

    def _solve(self, target: Array, twist: Array, codes: set[CrfCode], held: bool = False) -> None:
        with self.solver_meter.measure():
            step = self.solver.step(self.q, self.v, target, twist, held)
        self.solver_iterations = max(self.solver_iterations, step.iterations)
        codes.update(step.codes)
        self._integrate(step.velocity)

    def _integrate(self, velocity: Array) -> None:
        self.a = (velocity - self.v) / self.period
        self.q = self.q + velocity * self.period
        self.v = velocity

    def _torque(self, active: Reference, state: ArmState, codes: set[CrfCode]) -> Array | None:
        """The torques, or None where going on would break a limit of position or velocity: then the arm brakes."""
        self._measured(state)
        if self._ending is not None:
            self._brake(self._ending == "hard")
            return None
        lower, upper = ik.velocity_box(self.arm, self.q, self.v, self.period)
        if (self.v > upper).any() or (self.v < lower).any():
            codes.add(CrfCode.HardwareLimit)
            self._brake(hard=True)
            return None
        if active.space == "joints":
            return active.values
        torque = self.kinematics.jacobian(self.q).T @ active.values
        excess = float((np.abs(torque) / self.arm.limits.torque).max())
        return np.asarray(torque / max(1.0, excess))

    # -- how ----------------------------------------------------------------------------------------------------------

    def _end_reference(self, hard: bool) -> None:
        """Where a torque has brought the arm is only known when it is measured again."""
        if self._active is not None and self._active.signal == "torque":
            self._ending = "hard" if hard or self._ending == "hard" else "soft"
        else:
            self._brake(hard)

    def _begin_reference(self, reference: Reference) -> None:
        self._active, self._wanted = reference, None
        self._ramp = Ramp(reference.values.size)
        self._target = ik.forward(self.arm, self.q)
        self.queue = replace(self.queue, legs=(), rest=self.q, paused=False)

    def _stand(self) -> None:
        """It has come to rest, and nothing is queued."""
        self._active = self._ending = None
        self._by_solver = False
        self.v, self.a = np.zeros_like(self.v), np.zeros_like(self.a)
        self.queue = replace(self.queue, rest=self.q, legs=(), paused=False)

    def _measured(self, state: ArmState) -> None:
        limits = self.arm.limits
        self.q = np.clip(np.array(state.q), limits.lower, limits.upper)
        self.v, self.a = np.array(state.dq), np.zeros(self.arm.n)

    def _brake(self, hard: bool) -> None:
        """From here on a queue of one stop, off whatever path there was."""
        self._active = self._ending = None
        self._by_solver = False
        limits = hardware_limits(self.arm)
        now = Sample(self.q, self.v, self.a, None, 0.0, False)
        gentle = limits if hard else replace(limits, acceleration=self.profile.joint_acceleration)
        stop = stop_joints(self.time, now, gentle)
        if limits.outside(stop.rest) is not None:
            # Close to the end of a joint's range its whole deceleration is needed, and at once.
            stop = stop_joints(
                self.time, replace(now, ddq=np.zeros_like(self.a)), replace(limits, jerk=limits.jerk * 1e3)
            )
        legs = (QueuedMotion(stop, self.time, _STOP, stopped=True),)
        self.queue = replace(self.queue, rest=stop.rest, legs=legs, paused=False)


def _advanced(pose: Array, step: Array) -> Array:
    """``pose`` (3, 4) after a small twist (6,) over its time, in base axes at the tool."""
    angle = float(np.linalg.norm(step[3:]))
    x, y, z = step[3:] / max(angle, 1e-12)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
    return np.column_stack([turn @ pose[:, :3], pose[:, 3] + step[:3]])
