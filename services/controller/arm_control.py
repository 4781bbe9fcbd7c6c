"""What granted commands act on: one arm's motion, the planning of its paths, its gripper.

Times are nanoseconds of the arm's clock (stamps of arm states) where they are integers, and seconds since the first
tick where they are floats.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from typing import Literal

from rackhand.schemas.arrays import Array
from rackhand.schemas.base import Message
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import STREAM_INTERVALS, ArmState, Expected, MotionStatus, RobotConfiguration
from rackhand.services.controller import ik
from rackhand.services.controller.access.streams import StreamGuard, StreamSample
from rackhand.services.controller.access.types import ContinueMotion, MotionEffect, StopMotion
from rackhand.services.controller.commands.spec import GrantedCommand, Result
from rackhand.services.controller.motion.contact import describe
from rackhand.services.controller.motion.contact_reaction import ContactReaction
from rackhand.services.controller.motion.executor import CommandMode, MotionExecutor
from rackhand.services.controller.motion.meter import Stopwatch
from rackhand.services.controller.motion.plan_worker import Answered, Append, PathPlanner
from rackhand.services.controller.motion.profile import configuration
from rackhand.services.controller.motion.signal import SignalReference
from rackhand.services.controller.motion.status import Observer, StatusCodes
from rackhand.services.controller.trajectory.model import PathRefused, TcpPose

NO_DRIVER = "the arm driver is not connected"
STANDSTILL = 0.05  # rad/s measured
Finish = Callable[[GrantedCommand, Message, str], None]


class ArmControl:
    """``finish`` gives a command's answer to its caller; ``failed`` gets what has failed inside, for the log."""

    def __init__(
        self,
        arm: ik.Arm,
        period_ns: int,
        pool: Executor,
        stopwatch: Stopwatch,
        finish: Finish,
        failed: Callable[[BaseException], None],
    ) -> None:
        self.period_ns = period_ns
        self._model, self._finish, self._failed = arm, finish, failed
        self.motion = MotionExecutor(arm, period_ns * 1e-9, stopwatch)
        self._plans: PathPlanner[GrantedCommand] = PathPlanner(pool, period_ns * 1e-9)
        self.configuration: RobotConfiguration = configuration(arm, self.motion.profile, period_ns)
        self.complete_status: Callable[[MotionStatus, int], MotionStatus] = lambda status, _: status
        self.contact = ContactReaction(arm, self.motion)
        self.driver_fault = NO_DRIVER  # why the arm cannot be moved, for as long as it cannot
        self.obeyed = True  # whether the driver follows this controller's commands, as far as is known
        self.reset(())

    def reset(self, codes: tuple[CrfCode, ...]) -> None:
        """The driver is disconnected: the next tick starts from its arm state. Until then the status shows
        ``codes``."""
        self._guard = StreamGuard()
        self._observer = Observer(self.motion.kinematics)
        self.contact.reset()
        self.codes = StatusCodes()
        self.codes.add(codes)
        self.now = self._origin = 0
        self._tick: int | None = None
        self._lockstep = False
        self.suction: bool | None = None
        self._serial = self._reported = 0

    # -- state --------------------------------------------------------------------------------------------------------

    @property
    def connected(self) -> bool:
        """Whether arm states come from a driver that follows this controller."""
        return self._tick is not None and self.obeyed

    @property
    def busy(self) -> bool:
        """Whether a path is being planned."""
        return self._plans.busy

    @property
    def stopped_by_singularity(self) -> bool:
        """Whether the stop condition for low manipulability is on, and met."""
        return CrfCode.LowManipulability in self.motion.tuning.stops_on and self.motion.low_manipulability

    def tool_pose(self) -> TcpPose:
        """Of the tool as commanded, in the base frame."""
        return self.motion.kinematics.forward(self.motion.q)

    def status(self) -> MotionStatus:
        """Measured signals and codes, completed with the fields of priority access."""
        running = self.connected and (self.motion.running or self._plans.busy)
        status = self._observer.status(self.codes.ascending, running, self.contact.last)
        return self.complete_status(status, self.now)

    # -- commands -----------------------------------------------------------------------------------------------------

    def started(self, granted: GrantedCommand) -> None:
        """``granted`` is executed now: the arm is at rest again only after it."""
        self._serial = max(self._serial, granted.decision.serial)

    def append(
        self, kind: Literal["joints", "task"], append: Append, points: int, granted: GrantedCommand
    ) -> Result | None:
        """Plans a path; its caller is answered when the plan is known. ``points``: number of its waypoints."""
        if not self.connected:
            return Result.failed(CrfCode.Forbidden, self.driver_fault)
        if self._plans.full:
            return Result.failed(CrfCode.ServiceUnavailable, "too many paths are waiting to be planned")
        self._begin_motion()
        self.motion.make_way(kind)
        self._plans.add(append, points, granted)
        self.plan()
        return None

    def follow(self, reference: SignalReference, sample: StreamSample, name: str) -> Result:
        """Follows a velocity or torque from now on, unless ``sample`` is stale. Paths that are being planned are
        dropped in favour of ``name``."""
        if not self.connected:
            return Result.failed(CrfCode.Forbidden, self.driver_fault)
        if held := self.contact.refuses(self.now):
            return Result.failed(CrfCode.EndEffectorToleranceViolation, held)
        fresh = self._guard.offer(sample, self.now)
        if not fresh.ok:
            return Result.failed(fresh.code, fresh.text, fresh.detail)
        self._begin_motion()
        self.cancel_plans(CrfCode.Conflict, f"{name} replaces it")
        self.motion.follow(reference)
        return Result.done()

    def set_profile(self, name: str, values: Array) -> Array:
        """Sets one vector of the profile for paths appended from now on; what the arm's limits leave of it."""
        self.motion.set_profile(replace(self.motion.profile, **{name: values}))
        self.configuration = configuration(self._model, self.motion.profile, self.period_ns)
        used: Array = getattr(self.motion.profile, name)
        return used

    def set_suction(self, suction: bool) -> Result:
        if not self.connected:
            return Result.failed(CrfCode.Forbidden, self.driver_fault)
        self.suction = suction
        return Result.done()

    def start_control_loop(self) -> Result:
        """A control loop without motion: the status codes of the last motion are cleared."""
        if not self.connected:
            return Result.failed(CrfCode.Forbidden, self.driver_fault)
        self._begin_motion()
        return Result.done()

    def apply(self, effect: MotionEffect) -> None:
        """Carries out what priority access decides about motion."""
        self._serial = max(self._serial, effect.serial)
        match effect:
            case ContinueMotion():
                self.motion.resume()
            case StopMotion(kind=kind, clear=clear, reason=reason):
                self.cancel_plans(CrfCode.Conflict, reason)
                self._guard.stop(self.now)
                if kind == "hardStop":
                    self.motion.hard_stop()
                elif clear:
                    self.motion.soft_stop()
                else:
                    self.motion.pause()

    def _begin_motion(self) -> None:
        if self.motion.standing and not self._plans.busy:
            self.codes.begin()
            self.contact.last = None

    # -- ticks --------------------------------------------------------------------------------------------------------

    def begin_tick(self, state: ArmState, lockstep: bool) -> frozenset[CrfCode]:
        """Takes in the measured ``state``; ``RealTimeViolation`` where a tick was missed before it."""
        stamp, self._lockstep = state.stamp, lockstep
        late = False
        if self._tick is None:
            self._origin = stamp
            self.motion.begin_at(state, 0.0)
        else:
            missed = stamp - self._tick - self.period_ns
            late = missed > self.period_ns // 2
            if missed > STREAM_INTERVALS * self.period_ns:
                # The driver brakes the arm since more than a period: it goes on from where its motion was.
                self._origin += missed
        self.now = max(self.now, stamp)
        self._tick = stamp
        self._observer.see(state)
        if self.suction is None:
            # A gripper keeps what it was doing before this controller came: dropping a load is worse than holding it.
            self.suction = state.gripper is not None and state.gripper.suction
        return frozenset({CrfCode.RealTimeViolation}) if late else frozenset()

    def command(self, state: ArmState, late: frozenset[CrfCode]) -> tuple[CommandMode, list[float]]:
        """Mode and values of the command that answers ``state``."""
        if self._guard.expired(self.now):
            self.motion.end_reference()
        self._watch_contact(state, bool(late))
        self._collect(tick=True, lockstep=self._lockstep)
        mode, values = self.motion.tick(self._time(), state)
        codes = self.motion.codes | late
        self.codes.add(codes)
        self._stop_if_asked(codes)
        self.plan()
        return mode, list(values)

    def _watch_contact(self, state: ArmState, late: bool) -> None:
        contact = self.contact.see(state, late)
        if contact is not None:
            self.codes.add({CrfCode.EndEffectorToleranceViolation})
            if contact.stopped:
                self.cancel_plans(CrfCode.Conflict, describe(contact))
                self._guard.stop(self.now)
        if not self._plans.busy:
            self.motion.settle(state)

    def rested(self, state: ArmState) -> int | None:
        """The serial up to which everything is done, once when the arm has come to rest with nothing queued."""
        still = max(map(abs, state.dq)) < STANDSTILL
        if self._reported >= self._serial or not still or not self.motion.standing or self._plans.busy:
            return None
        self._reported = self._serial
        return self._serial

    def _stop_if_asked(self, codes: frozenset[CrfCode]) -> None:
        """Stops softly where a stop condition that is switched on is met."""
        met = codes & self.motion.tuning.stops_on
        if met and not self.motion.standing:
            names = ", ".join(code.name for code in sorted(met))
            self.cancel_plans(CrfCode.Conflict, f"stop condition: {names}")
            self._guard.stop(self.now)
            self.motion.soft_stop()

    def _time(self) -> float:
        """Seconds from the first tick to the last, without those for which the driver has stopped the arm."""
        assert self._tick is not None
        return (self._tick - self._origin) * 1e-9

    # -- plans --------------------------------------------------------------------------------------------------------

    def plan(self) -> None:
        """Starts planning the next path, if one waits and can be planned now."""
        if self.connected and self.motion.plannable:
            self._plans.begin(self.motion.queue, self._time(), self._lockstep)

    def await_plan(self, seconds: float) -> None:
        """Waits for the plan under way, at most so long."""
        self._plans.await_plan(seconds)

    def collect_plans(self) -> None:
        """Between ticks: answers the callers of plans that are ready."""
        if self.connected:
            self._collect(tick=False, lockstep=False)

    def cancel_plans(self, code: CrfCode, why: str) -> None:
        """Drops every path that is not being driven, and answers its caller."""
        for granted in self._plans.cancel():
            self._finish(granted, Expected[bool].failed(code), f"dropped before it started: {why}")

    def _collect(self, tick: bool, lockstep: bool) -> None:
        answers, queue = self._plans.collect(self._time(), tick, lockstep)
        for answer in answers:
            self._answer_path(answer)
        if queue is not None:
            self.motion.drive(queue)

    def _answer_path(self, answer: Answered[GrantedCommand]) -> None:
        if answer.error is None:
            self._finish(answer.ticket, Expected[bool].of(True), "")
            return
        if isinstance(answer.error, PathRefused):
            code, text = CrfCode.BadRequest, str(answer.error)
        else:
            self._failed(answer.error)
            code, text = CrfCode.InternalServerError, "planning failed; see the controller's log"
        if answer.first:
            self._finish(answer.ticket, Expected[bool].failed(code), text)
