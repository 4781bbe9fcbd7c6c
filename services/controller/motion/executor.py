"""The joint command of each tick: along the queued paths, at a velocity, with a torque, or to a stop.

Paths are the default: an idle arm is an empty queue. A velocity or torque reference begins from rest and ends in a
queue. What must end while it moves becomes a queue of one stop, so that what follows can be planned at once.
Times are seconds of the arm's clock. ``q``, ``v``, ``a`` are commanded and belong to ``time``, the end of the period
that the last command was for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import ArmState
from rackhand.services.controller import ik
from rackhand.services.controller.motion.braking import braking
from rackhand.services.controller.motion.foresight import Foresight
from rackhand.services.controller.motion.kinematics import ArmKinematics
from rackhand.services.controller.motion.meter import Stopwatch, no_stopwatch
from rackhand.services.controller.motion.metered_solver import MeteredSolver
from rackhand.services.controller.motion.parameters import Tuning
from rackhand.services.controller.motion.path_clearance import PathClearance
from rackhand.services.controller.motion.profile import MotionProfile, hardware_limits, path_arm
from rackhand.services.controller.motion.signal import SignalReference
from rackhand.services.controller.motion.torque import ahead, joint_torques, must_brake
from rackhand.services.controller.motion.velocity import JointVelocity, TaskVelocity, VelocityFollower
from rackhand.services.controller.trajectory.geometry import TaskPath
from rackhand.services.controller.trajectory.queue import MotionQueue, QueuedMotion
from rackhand.services.controller.trajectory.stream import Motion, Sample

CommandMode = Literal["position", "velocity", "torque"]

AT_REST = 1e-6  # rad/s commanded
STILL = 0.01  # rad/s measured
# A tool that was held back catches up with where its velocity ended, until its joints are slow (rad/s) and will be in
# the next SOON (s), or for so long (s). Joints that only pass through zero would swing out of the line in the stop,
# which fades their acceleration.
SLOW, SOON, LONGEST_ARRIVAL = 0.02, 0.02, 0.5
# rad: farther from where it is held, after a stop, the arm is held where it is instead.
SETTLED_STOP, SETTLED_CONTACT = 0.01, 0.001
SETTLED_TIME = 0.2  # s for which it must be still there: what was pressed springs back only after it is let go
LONGEST_WAY_NS = 60_000_000  # for which a command may be on its way to the driver
_STOP = "stop"


class MotionExecutor:
    """One arm's motion. See the module."""

    def __init__(self, arm: ik.Arm, period: float, stopwatch: Stopwatch = no_stopwatch) -> None:
        self.arm, self.period = arm, period
        self.kinematics = ArmKinematics(arm)
        self._foresight = Foresight(self.kinematics)
        self.solver = MeteredSolver(ik.DifferentialIk(arm, period), stopwatch)
        self.tuning = Tuning(self.solver.ik)
        self.profile = MotionProfile.default(arm)
        self._check = PathClearance(arm)
        self._clearance = ik.Clearance(arm)
        self.queue = MotionQueue(path_arm(arm, self.profile, self._check), arm.home)
        self.time = 0.0
        self.codes: frozenset[CrfCode] = frozenset()
        self._active: SignalReference | None = None  # the reference that is followed; its values may be zero by now
        self._next: SignalReference | None = None  # the reference to follow once the arm is at rest
        self._ending: Literal["soft", "hard"] | None = None  # how a torque ends, at the next measurement
        self._follower: VelocityFollower = JointVelocity(arm, self._clearance, period)
        self._by_solver = False
        self._arriving = 0.0  # seconds since the reference ended
        self._settles: float | None = None  # after a stop, until the arm is at rest: how exactly it is held
        self._still = 0.0  # seconds for which it has been at rest there
        self._measured_v = np.zeros(arm.n)  # of the tick before, while a torque acts
        # After a torque, until the driver follows a position: the stamp that the first answers, and how the arm brakes.
        self._hands_over: tuple[int, Literal["soft", "hard"]] | None = None
        self.q, self.v, self.a = arm.home.copy(), np.zeros(arm.n), np.zeros(arm.n)

    # -- state --------------------------------------------------------------------------------------------------------

    @property
    def standing(self) -> bool:
        """Nothing moves, nor will without another command. A paused queue counts as standing."""
        if self._active is not None or self._next is not None:
            return False
        return not self.queue.running(self.time) and bool(np.abs(self.v).max() <= AT_REST)

    @property
    def running(self) -> bool:
        """Whether a path is being driven."""
        return self._active is None and self.queue.running(self.time)

    @property
    def plannable(self) -> bool:
        """Whether waypoints can be planned from the end of the queue. Not while the solver chooses the posture on the
        path, nor before a reference has ended, for the driver too."""
        return self._active is None and self._hands_over is None and not (self._by_solver and self.queue.motions)

    @property
    def gives_way(self) -> bool:
        """Whether it is being stopped because something holds it."""
        return self._settles == SETTLED_CONTACT and not self.standing

    @property
    def follows(self) -> bool:
        """Whether a velocity or torque is followed."""
        return self._active is not None

    @property
    def by_torque(self) -> bool:
        """Whether a torque moves the arm, which may press against something."""
        return self._active is not None and self._active.signal == "torque"

    @property
    def hands_over(self) -> bool:
        """Whether the driver has not taken the first position after a torque yet."""
        return self._hands_over is not None

    @property
    def rotation(self) -> Array:
        """(3, 3), of the flange in the base, as commanded."""
        return self._foresight.rotation(self.q)

    @property
    def low_manipulability(self) -> bool:
        return self.kinematics.manipulability(self.q) < self.solver.ik.settings.low_manipulability

    # -- commands -----------------------------------------------------------------------------------------------------

    def begin_at(self, state: ArmState, t: float) -> None:
        """At the first arm state: the arm is held where it is, or stopped if it moves."""
        self.time, self._next, self._hands_over = t, None, None
        self._set_measured(state)
        self._brake(hard=False)

    def set_profile(self, profile: MotionProfile) -> None:
        """For paths appended from now on."""
        self.profile = profile.bounded(self.arm)
        self.queue = replace(self.queue, arm=path_arm(self.arm, self.profile, self._check))

    def follow(self, reference: SignalReference) -> None:
        """A new velocity or torque: at once if one of its kind is followed, else when the arm has stopped softly."""
        if self._active is not None and self._ending is None and self._active.same_kind(reference):
            self._active = reference
            return
        self.soft_stop()
        self._next = reference

    def end_reference(self) -> None:
        """The reference was not refreshed in time: a velocity ramps down to zero, a torque ends in a stop."""
        self._next = None
        if self._active is None:
            return
        if self._active.signal == "torque":
            self._end_active(hard=False)
        else:
            self._active = replace(self._active, values=np.zeros_like(self._active.values))

    def give_way(self, state: ArmState) -> None:
        """Something holds the arm: every joint stops as fast as it can, from where it is measured."""
        self._next = None
        self._set_measured(state)
        self._brake(hard=True)
        self._settles = SETTLED_CONTACT

    def touched(self) -> None:
        """Something pushes the arm: after a stop it is held exactly where it is then."""
        if self._settles is not None:
            self._settles = SETTLED_CONTACT

    def settle(self, state: ArmState) -> None:
        """After a stop the arm is held where it is: what has kept it off its path may go, and nothing moves. To be
        called before a tick, unless a path is being planned from where the arm is held."""
        if self._settles is None or not self.standing:
            return
        off, speed = np.array(state.q) - self.q, np.array(state.dq)
        is_off = np.abs(off) > self._settles
        # What is driven off is held back first: a position that goes along would lead it on.
        is_driven_off = is_off & (off * speed > 0.0) & (np.abs(speed) > STILL)
        if is_off.any() and not is_driven_off.any():
            self._set_measured(state)
            self._brake(hard=True)
        elif np.abs(speed).max() < STILL:
            self._still += self.period
            if self._still >= SETTLED_TIME:
                self._settles = None
            return
        self._still = 0.0

    def soft_stop(self) -> None:
        """Along the path, within the profile's limits; the queue is dropped."""
        self._next, self._settles = None, self._settles or SETTLED_STOP
        if self._active is not None:
            self._end_active(hard=False)
        else:
            self.queue = self.queue.soft_stop(self.time)

    def hard_stop(self) -> None:
        """Every joint as fast as the arm can."""
        self._next, self._settles = None, self._settles or SETTLED_STOP
        if self._hands_over is not None:
            self._hands_over = (self._hands_over[0], "hard")
        if self._active is not None:
            self._end_active(hard=True)
        elif self.queue.running(self.time):
            self._brake(hard=True)
        else:
            self.queue = self.queue.soft_stop(self.time)

    def pause(self) -> None:
        """Stops as ``soft_stop`` does, and keeps the queue. Of a reference there is nothing to keep."""
        if self._active is not None or self._next is not None:
            self.soft_stop()
        else:
            self.queue = self.queue.pause(self.time)

    def resume(self) -> None:
        """Drives a queue that ``pause`` has kept."""
        self.queue = self.queue.resume(self.time)

    def make_way(self, kind: Literal["joints", "task"]) -> None:
        """Before waypoints of ``kind`` are planned: ends what they cannot be appended to."""
        if self._active is not None or self._next is not None or (self._by_solver and kind == "joints"):
            self.soft_stop()

    def drive(self, queue: MotionQueue) -> None:
        """Takes over a queue that was planned from the present one."""
        self._settles = None
        if not self.queue.motions:
            motions = [queued.motion for queued in queue.motions]
            tasks = all(isinstance(motion, Motion) and isinstance(motion.path, TaskPath) for motion in motions)
            self._by_solver = self.tuning.shapes_paths and tasks
        self.queue = replace(queue, arm=self.queue.arm)

    # -- ticks --------------------------------------------------------------------------------------------------------

    def tick(self, t: float, state: ArmState) -> tuple[CommandMode, Sequence[float]]:
        """The command for the period that begins at ``t``, at which ``state`` was measured."""
        if t > self.time + 0.5 * self.period:
            # Ticks were missed: the last command has been reached and held.
            self.time = t
        if self._hands_over is not None:
            self._hand_over(state, *self._hands_over)
        if self._next is not None and self._active is None and not self.queue.running(self.time):
            self._begin_reference(self._next)
        codes: set[CrfCode] = set()
        mode: CommandMode = "position"
        values = self.q
        if self._active is not None and self._active.signal == "torque":
            torque = self._torque(self._active, state, codes)
            if torque is not None:
                mode, values = "torque", torque
        if mode == "position":
            if self._active is not None:
                self._velocity(self._active, codes)
            elif self.queue.motions:
                self._path(codes)
            values = np.clip(self.q, self.arm.limits.lower, self.arm.limits.upper)
        self.time += self.period
        self.codes = frozenset(codes)
        return mode, values.tolist()

    def prepare(self) -> None:
        """Between ticks: computes what the next tick needs if nothing changes until then."""
        if self._active is None and self.queue.motions and not self._by_solver:
            self._foresight.sample(self.queue, self.time + self.period)
        self._foresight.rotation(self.q)

    def _path(self, codes: set[CrfCode]) -> None:
        ahead = self.time + self.period
        if self._by_solver:
            self._track(self.queue.at(self.time), codes)
        else:
            sample = self._foresight.sample(self.queue, ahead)
            self.q, self.v, self.a = sample.q, sample.dq, sample.ddq
            if sample.task is not None and self.low_manipulability:
                codes.add(CrfCode.LowManipulability)
        if self.queue.running(ahead):
            return
        if np.abs(self.v).max() > AT_REST:
            # The solver has not quite arrived: the rest of its motion ends here.
            self._brake(hard=False, after=self.period)
        elif not self.queue.paused:
            self.queue = replace(self.queue, motions=(), rest=self.q)
            self.v, self.a = np.zeros_like(self.v), np.zeros_like(self.a)

    def _track(self, sample: Sample, codes: set[CrfCode]) -> None:
        """One period by the solver, which may choose another posture than the plan's."""
        if sample.task is None:
            self._brake(hard=False)
            return
        pose, twist = sample.task.pose, sample.task.twist + 0.5 * self.period * sample.task.accel
        target = np.column_stack([pose.rotation, pose.translation])
        step = self.solver.step(self.q, self.v, target, twist, held=False)
        codes.update(step.codes)
        self._integrate(step.velocity)

    def _velocity(self, active: SignalReference, codes: set[CrfCode]) -> None:
        velocity, raised = self._follower.step(active.values, self.q, self.v, self.profile)
        codes.update(raised)
        self._integrate(velocity)
        if active.values.any() or np.abs(self._follower.ramped).max() > AT_REST:
            self._arriving = 0.0
            return
        self._arriving += self.period
        if (np.abs(self.v) + SOON * np.abs(self.a)).max() > SLOW and self._arriving < LONGEST_ARRIVAL:
            return
        if np.abs(self.v).max() <= AT_REST:
            # No stop: that would fade the ramp's last acceleration, and swing back by it.
            self._rest()
        else:
            self._brake(hard=False, after=self.period)

    def _integrate(self, velocity: Array) -> None:
        self.a = (velocity - self.v) / self.period
        self.q = self.q + velocity * self.period
        self.v = velocity

    def _torque(self, active: SignalReference, state: ArmState, codes: set[CrfCode]) -> Array | None:
        """The torques, or None where the arm brakes from here on."""
        before = self._measured_v
        self._set_measured(state)
        gained, self._measured_v = self.v - before, self.v
        ended = self._ending
        if ended is None and must_brake(self.arm, self.q, self.v, gained, self.period):
            codes.add(CrfCode.HardwareLimit)
            ended = "hard"
        if ended is None and self._approaches(gained):
            codes.add(CrfCode.WorkspaceViolation)
            ended = "hard"
        if ended is None:
            return joint_torques(self.arm, self.kinematics, active, self.q)
        self._brake(ended == "hard")
        self._hands_over = (state.stamp, ended)
        return None

    def _hand_over(self, state: ArmState, first: int, ends: Literal["soft", "hard"]) -> None:
        """While the first position after a torque was on its way the torque still acted: the stop begins where the
        driver began to follow it. A driver that does not report what it follows gets no second beginning."""
        taken = state.follows is None or state.follows.answers >= first
        if taken or state.stamp - first > LONGEST_WAY_NS:
            self._hands_over = None
        if state.follows is not None:
            self._set_measured(state)
            self._brake(ends == "hard")

    def _approaches(self, gained: Array) -> bool:
        """Whether a torque must end, or the arm could not stop before it touches itself or its station."""
        q, v = ahead(self.q, self.v, gained, self.period)
        return self._clearance.speed_share(q, v, self.period) < 1.0

    # -- transitions --------------------------------------------------------------------------------------------------

    def _end_active(self, hard: bool) -> None:
        """Where a torque has brought the arm is only known when it is measured again."""
        if self._active is not None and self._active.signal == "torque":
            self._ending = "hard" if hard or self._ending == "hard" else "soft"
        else:
            self._brake(hard)

    def _begin_reference(self, reference: SignalReference) -> None:
        self._active, self._next, self._settles = reference, None, None
        self._measured_v = self.v
        if reference.space == "joints":
            self._follower = JointVelocity(self.arm, self._clearance, self.period)
        else:
            self._follower = TaskVelocity(self.arm, self.solver, self._clearance, self.period, self.q)
        self.queue = replace(self.queue, motions=(), rest=self.q, paused=False)

    def _rest(self) -> None:
        """It has come to rest, and nothing is queued."""
        self._active = self._ending = None
        self._by_solver = False
        self.v, self.a = np.zeros_like(self.v), np.zeros_like(self.a)
        self.queue = replace(self.queue, rest=self.q, motions=(), paused=False)

    def _set_measured(self, state: ArmState) -> None:
        limits = self.arm.limits
        self.q = np.clip(np.array(state.q), limits.lower, limits.upper)
        self.v, self.a = np.array(state.dq), np.zeros(self.arm.n)

    def _brake(self, hard: bool, after: float = 0.0) -> None:
        """From here on, ``after`` seconds from ``time``, the queue is one stop."""
        self._active = self._ending = None
        self._by_solver = False
        begin, now = self.time + after, Sample(self.q, self.v, self.a, None, 0.0, False)
        stop = braking(begin, now, hardware_limits(self.arm), None if hard else self.profile.joint_acceleration)
        queued = QueuedMotion(stop, begin, _STOP, stopped=True)
        self.queue = replace(self.queue, rest=stop.rest, motions=(queued,), paused=False)
