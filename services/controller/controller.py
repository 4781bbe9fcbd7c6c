"""One arm's controller: requests and arm states in; answers, events and joint commands out. No bus, no clock.

It joins the protocol (``Dispatcher``), the planning of paths beside the loop (``PathPlanner``) and the motion itself
(``MotionExecutor``). The time of everything, keep-alives included, is the stamp of the newest arm state. A
paused world therefore keeps its locks, and a world ten times as fast runs them out ten times as soon.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.base import Message
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.fencing import FencingGuard
from rackhand.schemas.motion import ArmCommand, ArmState, ControlInfo, Expected, MotionEvent, MotionStatus
from rackhand.services.controller import ik
from rackhand.services.controller.access.access import Access
from rackhand.services.controller.access.streams import StreamGuard, StreamSample
from rackhand.services.controller.access.types import AccessConfig, ContinueMotion, Order, StopMotion
from rackhand.services.controller.motion.executor import MotionExecutor, Reference
from rackhand.services.controller.motion.loop_watch import LoopWatch
from rackhand.services.controller.motion.meter import Stopwatch, no_stopwatch
from rackhand.services.controller.motion.parameters import ParametersRefused
from rackhand.services.controller.motion.plan_worker import Answered, PathPlanner
from rackhand.services.controller.motion.profile import configuration
from rackhand.services.controller.motion.status import Observer, StatusCodes
from rackhand.services.controller.motion.waypoints import append_joints, append_task
from rackhand.services.controller.output import Output
from rackhand.services.controller.protocol.answers import encode, error
from rackhand.services.controller.protocol.checks import parameters_of
from rackhand.services.controller.protocol.dispatch import Admitted, Dispatcher, DispatchResult
from rackhand.services.controller.protocol.parse import Parsed, parse
from rackhand.services.controller.protocol.reading import LONG, ParseQueue, Reading
from rackhand.services.controller.trajectory.model import Array, PathRefused

STATUS_PERIOD_NS = 40_000_000
STANDSTILL = 0.05  # rad/s measured
GRIPPER_COMMANDS = frozenset({"setGripper"})


class Controller:
    """See the module. ``ticket`` is what the caller knows a request by; every ticket comes back with one answer."""

    def __init__(
        self,
        arm: ik.Arm,
        period_ns: int,
        executor: Executor,
        new_epoch: Callable[[], str],
        access: AccessConfig = AccessConfig(),  # noqa: B008 - it is frozen
        stopwatch: Stopwatch = no_stopwatch,
        not_offered: frozenset[str] = frozenset(),
        reader: Executor | None = None,
    ) -> None:
        self.period_ns = period_ns
        self._not_offered = not_offered
        self._arm, self._config, self._new_epoch = arm, access, new_epoch
        self.mover = MotionExecutor(arm, period_ns * 1e-9, stopwatch)
        self._watch = LoopWatch(self.mover, stopwatch)
        self._planner = PathPlanner(executor, period_ns * 1e-9)
        self._reading = ParseQueue(reader or executor, lambda text: self._dispatcher.read(text))
        self._hop = FencingGuard()
        self._output = Output()
        self._driver_fault = "the arm driver is not connected"
        self._waiting: dict[tuple[str, bytes], list[object]] = {}
        self._begin(())

    def _begin(self, codes: tuple[CrfCode, ...]) -> None:
        self.access = Access(self._new_epoch(), self._config)
        arm = configuration(self._arm, self.mover.profile, self.period_ns)
        self._dispatcher = Dispatcher(self.access, arm, self._not_offered)
        self._guard = StreamGuard()
        self._observer = Observer(self.mover.kinematics)
        self._codes = StatusCodes()
        self._codes.add(codes)
        self._now = self._origin = 0
        self._tick: int | None = None
        self._lockstep = False
        self._status_slot = -1
        self._serial = self._reported = 0
        self._suction: bool | None = None

    # -- what is heard ------------------------------------------------------------------------------------------------

    def take(self) -> Output:
        """What has come of everything since the last call."""
        output, self._output = self._output, Output()
        return output

    @property
    def busy(self) -> bool:
        """Whether a plan is being made or a request read: then ``poll`` has something to find."""
        return self._planner.busy or self._reading.busy

    def reset(self, why: str) -> None:
        """The arm driver disconnected or restarted: nobody holds control, nothing moves, nothing is queued."""
        self._driver_fault = why
        self._cancel(CrfCode.ServiceUnavailable, why)
        self._reading.overtake()
        held = self.access.holder(self._now)
        to = self._dispatcher.recipient(held.client) if held else ""
        epoch, stamp = self.access.epoch, self._now
        self._begin((CrfCode.Disconnected,))
        if held is not None:
            info = ControlInfo(
                client=held.client, priority=held.priority, lease_id=held.lease_id, epoch=epoch, reason="restart"
            )
            self._output.events.append(MotionEvent(stamp=stamp, name="controlLost", to=to, info=info))

    def disconnected(self, session: str) -> None:
        """A client's connection is gone."""
        self._reading.overtake(session)
        self._follow(self._dispatcher.disconnected(session, self._now))

    def stop_request(self, session: str, text: str, ticket: object) -> None:
        """A request on the way that is for stops only. It waits for nothing."""
        if len(text) > LONG:
            refusal = error("Not valid json format", f"{len(text)} characters, a stop has at most {LONG}")
            self._output.replies.append((ticket, encode(refusal).decode()))
            return
        parsed = parse(text, self._arm.n)
        if isinstance(parsed.result, crf.Request) and not isinstance(parsed.result, crf.SoftStop | crf.HardStop):
            refusal = error(f"Unknown command: {parsed.result.command}", "only softStop and hardStop are taken here")
            self._output.replies.append((ticket, encode(refusal, parsed.echo).decode()))
        else:
            self._request(session, text, ticket, parsed)

    def request(self, session: str, text: str, ticket: object) -> None:
        if not self._reading.wanted(session, text):
            self._request(session, text, ticket, None)
        elif self._reading.full:
            refusal = error(CrfCode.ServiceUnavailable, "too many long requests are being read")
            self._output.replies.append((ticket, encode(refusal).decode()))
        else:
            self._reading.take(session, text, ticket)

    def _take_in(self, lockstep: bool) -> None:
        """Long requests that are read by now."""
        for reading in self._reading.collect(lockstep):
            try:
                self._take_in_one(reading)
            except Exception as failure:  # nobody else's request, and no tick, fails with it
                self._output.errors.append(failure)
                refusal = error(CrfCode.InternalServerError, "the controller failed to answer; its log says more")
                self._output.replies.append((reading.ticket, encode(refusal).decode()))

    def _take_in_one(self, reading: Reading) -> None:
        parsed = reading.future.result() if reading.future else self._dispatcher.read(reading.text)
        if reading.overtaken and isinstance(parsed.result, crf.ControlRequest):
            refusal = error(CrfCode.Conflict, "a stop has overtaken it while it was read")
            self._output.replies.append((reading.ticket, encode(refusal, parsed.echo).decode()))
        else:
            self._request(reading.session, reading.text, reading.ticket, parsed)

    def _request(self, session: str, text: str, ticket: object, parsed: Parsed | None) -> None:
        turn = self._dispatcher.request(session, text, self._now, parsed)
        self._follow(turn)
        if turn.reply is not None:
            self._output.replies.append((ticket, turn.reply.decode()))
        elif turn.shared is not None:
            self._waiting.setdefault(turn.shared, []).append(ticket)
        elif turn.admitted is not None:
            self._carry_out(turn.admitted, ticket)

    def await_plan(self, seconds: float) -> None:
        """Wait for the plan that is being made, so long at most."""
        self._planner.await_plan(seconds)

    def poll(self) -> None:
        """Between ticks: plans that are ready are answered, so that a paused world answers too; and what may wait until
        the command is on its way."""
        self._take_in(lockstep=False)
        if self._tick is not None:
            self._collect(self._time(self._tick), tick=False, lockstep=False)
            self._output.path = self._watch.changed_path(self._now) or self._output.path

    def tick(self, state: ArmState, lockstep: bool) -> ArmCommand:
        """One control period. ``lockstep``: whoever measures waits for the answer, so plans are waited for here."""
        with self._watch.meter.measure():
            return self._answer(state, lockstep)

    def _answer(self, state: ArmState, lockstep: bool) -> ArmCommand:
        now, self._lockstep = state.stamp, lockstep
        late: frozenset[CrfCode] = frozenset()
        if self._tick is None:
            self._origin = now
            self.mover.begin_at(state, 0.0)
        elif now - self._tick > 1.5 * self.period_ns:
            late = frozenset({CrfCode.RealTimeViolation})
            self._watch.late_ticks += 1
        self._now = max(self._now, now)
        self._tick = now
        t = self._time(now)
        self._observer.see(state)
        self._see_gripper(state)
        self._follow(self._dispatcher.tick(now))
        self._take_in(lockstep)
        if self._guard.expired(now):
            self.mover.silence()
        self._collect(t, tick=True, lockstep=lockstep)
        commanded = self.mover.q
        mode, values = self.mover.tick(t, state)
        self._codes.add(self.mover.codes | late)
        self._heed(self.mover.codes | late)
        self._plan()
        self._report_rest(state)
        self._publish_status(state, commanded)
        token = self.access.token
        self._hop.raise_to(token)
        if not self._hop.admit(token, now):
            raise AssertionError(f"a command of {token} after {self._hop.newest}")
        return ArmCommand(answers=now, mode=mode, values=tuple(values), token=token, suction=bool(self._suction))

    def _see_gripper(self, state: ArmState) -> None:
        """What it was doing before this controller came it goes on doing: to drop a load is worse than to hold it."""
        if self._suction is None:
            self._suction = state.gripper is not None and state.gripper.suction
        missing = frozenset() if state.gripper is not None else GRIPPER_COMMANDS
        self._dispatcher.not_offered = self._not_offered | missing

    def _time(self, stamp: int) -> float:
        """Seconds since the first tick, in whole periods: so that times of ticks compare."""
        return (stamp - self._origin) * 1e-9

    # -- what follows -------------------------------------------------------------------------------------------------

    def _follow(self, turn: DispatchResult) -> None:
        for order in turn.orders:
            self._obey(order)
        for event in turn.events:
            to = self._dispatcher.recipient(event.to)
            told = MotionEvent(stamp=self._now, name=event.name, to=to, info=event.info)
            self._output.events.append(told)
        self._output.audit.extend(turn.audit)

    def _obey(self, order: Order) -> None:
        self._serial = max(self._serial, order.serial)
        match order:
            case ContinueMotion():
                self.mover.resume()
            case StopMotion(kind=kind, clear=clear, reason=reason):
                self._reading.overtake()
                self._cancel(CrfCode.Conflict, reason)
                self._guard.stop(self._now)
                if kind == "hardStop":
                    self.mover.hard_stop()
                elif clear:
                    self.mover.soft_stop()
                else:
                    self.mover.pause()

    def _heed(self, codes: frozenset[CrfCode]) -> None:
        """Stops by itself where a stop condition that is switched on has come up."""
        met = codes & self.mover.tuning.stops_on
        if met and not self.mover.standing:
            names = ", ".join(code.name for code in sorted(met))
            self._cancel(CrfCode.Conflict, f"stop condition: {names}")
            self._guard.stop(self._now)
            self.mover.soft_stop()

    def _report_rest(self, state: ArmState) -> None:
        still = max(map(abs, state.dq)) < STANDSTILL
        if self._reported < self._serial and still and self.mover.standing and not self._planner.busy:
            self._reported = self._serial
            self._follow(self._dispatcher.at_rest(self._serial, self._now))

    def _publish_status(self, state: ArmState, commanded: Array) -> None:
        slot = self._now // STATUS_PERIOD_NS
        if slot == self._status_slot and not self._dispatcher.streams:
            return  # to make a status costs more than the rest of a tick
        status = self._status()
        due = self._dispatcher.due(status, self._now)
        self._output.streams.extend((session, text.decode()) for session, text in due)
        if slot != self._status_slot:
            self._status_slot = slot
            self._output.status = status
            self._output.diagnostics = self._watch.diagnostics(state, commanded)

    def _status(self) -> MotionStatus:
        running = self.mover.running or (self._planner.busy and self._tick is not None)
        return self._dispatcher.complete(self._observer.status(self._codes.ascending, running), self._now)

    # -- plans --------------------------------------------------------------------------------------------------------

    def _plan(self) -> None:
        if self._tick is not None and self.mover.plannable:
            self._planner.begin(self.mover.queue, self._time(self._tick), self._lockstep)

    def _collect(self, t: float, tick: bool, lockstep: bool) -> None:
        answers, queue = self._planner.collect(t, tick, lockstep)
        for answer in answers:
            self._answer_path(answer)
        if queue is not None:
            self.mover.drive(queue)

    def _answer_path(self, answer: Answered) -> None:
        admitted, ticket = _pair(answer.ticket)
        if answer.error is None:
            self._finish(admitted, ticket, Expected[bool].of(True))
            return
        if isinstance(answer.error, PathRefused):
            code, text = CrfCode.BadRequest, str(answer.error)
        else:
            self._output.errors.append(answer.error)
            code, text = CrfCode.InternalServerError, "planning failed; the controller's log says more"
        if answer.first:
            self._finish(admitted, ticket, Expected[bool].failed(code), text)

    def _cancel(self, code: CrfCode, why: str) -> None:
        for pair in self._planner.cancel():
            admitted, ticket = _pair(pair)
            self._finish(admitted, ticket, Expected[bool].failed(code), f"dropped before it began: {why}")

    # -- commands -----------------------------------------------------------------------------------------------------

    def _finish(self, admitted: Admitted, ticket: object, result: Message, text: str = "") -> None:
        answer = self._dispatcher.finish(admitted, result, text).decode()
        tickets = [ticket, *(self._waiting.pop(admitted.key, []) if admitted.key else [])]
        self._output.replies.extend((each, answer) for each in tickets)

    def _carry_out(self, admitted: Admitted, ticket: object) -> None:
        request = admitted.request
        if isinstance(request, crf.GetStatus):
            self._finish(admitted, ticket, self._status())
            return
        self._serial = max(self._serial, admitted.verdict.serial)
        if isinstance(request, crf.AppendJointsPath | crf.AppendTaskPath):
            self._append(request, admitted, ticket)
            return
        result, text = self._command(request, admitted)
        self._finish(admitted, ticket, result, text)

    def _append(self, request: crf.AppendJointsPath | crf.AppendTaskPath, admitted: Admitted, ticket: object) -> None:
        if wrong := self._cannot_move():
            self._finish(admitted, ticket, wrong[0], wrong[1])
            return
        if self._planner.full:
            busy = Expected[bool].failed(CrfCode.ServiceUnavailable)
            self._finish(admitted, ticket, busy, "too many paths are waiting to be planned")
            return
        self._begin_motion()
        self.mover.make_way(request.type)
        if isinstance(request, crf.AppendJointsPath):
            append = append_joints(request)
        else:
            append = append_task(request, self.mover.kinematics.forward(self.mover.q))
        self._planner.add(append, len(request.data), (admitted, ticket))
        self._plan()

    def _command(self, request: crf.Request, admitted: Admitted) -> tuple[Expected[bool], str]:
        match request:
            case crf.SetVelocity() | crf.SetTorque():
                return self._refer(request, admitted)
            case crf.SetProfileVelocity() | crf.SetProfileAcceleration():
                return self._set_profile(request)
            case crf.SetParameters():
                try:
                    self.mover.tuning.apply(parameters_of(request).controller)
                except ParametersRefused as refused:
                    return Expected[bool].failed(refused.code), str(refused)
            case crf.SetGripper(suction=suction):
                if wrong := self._cannot_move():
                    return wrong
                self._suction = suction
            case crf.StartJointsControl() | crf.StartTaskControl():
                if wrong := self._cannot_move():
                    return wrong
                self._begin_motion()
        return Expected[bool].of(True), ""

    def _refer(self, request: crf.SetVelocity | crf.SetTorque, admitted: Admitted) -> tuple[Expected[bool], str]:
        if wrong := self._cannot_move():
            return wrong
        task = request.type == "task"
        if task and isinstance(request, crf.SetVelocity) and self._too_singular():
            return Expected[bool].failed(CrfCode.LowManipulability), "the arm is near a singularity"
        token = admitted.verdict.token or self.access.token
        timeout = None if request.timeout is None else int(min(request.timeout, 1.0) * 1e9)
        fresh = self._guard.offer(StreamSample(token, request.sequence, request.stamp, timeout), self._now)
        if not fresh.ok:
            return Expected[bool].failed(fresh.code, fresh.detail), fresh.text
        values = np.array(request.data)
        if task and request.reference == 2:
            rotation = self.mover.rotation()
            values = np.concatenate([rotation @ values[:3], rotation @ values[3:]])
        self._begin_motion()
        self._cancel(CrfCode.Conflict, f"{request.command} takes over")
        self.mover.follow(
            Reference("velocity" if isinstance(request, crf.SetVelocity) else "torque", request.type, values)
        )
        return Expected[bool].of(True), ""

    def _set_profile(self, request: crf.SetProfileVelocity | crf.SetProfileAcceleration) -> tuple[Expected[bool], str]:
        what = "velocity" if isinstance(request, crf.SetProfileVelocity) else "acceleration"
        name = f"{'joint' if request.type == 'joints' else 'task'}_{what}"
        wanted = np.array(request.data)
        self.mover.set_profile(replace(self.mover.profile, **{name: wanted}))
        self._dispatcher.arm = configuration(self._arm, self.mover.profile, self.period_ns)
        set_to = getattr(self.mover.profile, name)
        bounded = bool((set_to < wanted).any())
        return Expected[bool].of(True), f"bounded by the arm's limits: {set_to.tolist()}" if bounded else ""

    def _begin_motion(self) -> None:
        if self.mover.standing and not self._planner.busy:
            self._codes.begin()

    def _too_singular(self) -> bool:
        return CrfCode.LowManipulability in self.mover.tuning.stops_on and self.mover.low_manipulability

    def _cannot_move(self) -> tuple[Expected[bool], str] | None:
        if self._tick is not None:
            return None
        return Expected[bool].failed(CrfCode.Forbidden), self._driver_fault


def _pair(ticket: Any) -> tuple[Admitted, object]:
    admitted, inner = ticket
    return admitted, inner
