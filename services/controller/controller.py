"""One arm's controller: requests and arm states in; answers, events and joint commands out. No bus, no clock.

It joins the requests (``RequestHandler``), the arm they act on (``ArmControl``) and what is published (``Reporter``).
The time of everything, keep-alives included, is the stamp of the newest arm state. A paused world therefore keeps its
locks, and in a world ten times as fast they expire ten times as soon.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.fencing import FencingGuard
from rackhand.schemas.motion import ArmCommand, ArmState, ControlInfo, MotionEvent
from rackhand.services.controller import ik
from rackhand.services.controller.access.access import Access
from rackhand.services.controller.access.types import AccessConfig
from rackhand.services.controller.arm_control import ArmControl
from rackhand.services.controller.commands.spec import CommandTable
from rackhand.services.controller.commands.table import COMMANDS
from rackhand.services.controller.motion.driver_watch import DriverWatch
from rackhand.services.controller.motion.executor import CommandMode, MotionExecutor
from rackhand.services.controller.motion.meter import Stopwatch, no_stopwatch
from rackhand.services.controller.outputs import ControllerOutput, Outbox
from rackhand.services.controller.protocol.dispatch import Dispatcher
from rackhand.services.controller.reporting import Reporter
from rackhand.services.controller.requests import RequestHandler

GRIPPER_COMMANDS = frozenset({"setGripper"})


class Controller:
    """See the module. ``ticket`` is the caller's name for a request; every ticket comes back with one answer.

    ``executor`` plans paths and, without a ``reader``, parses long requests. ``new_epoch`` names the fencing epochs,
    ``not_offered`` the commands that are answered with 405.
    """

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
        commands: CommandTable = COMMANDS,
    ) -> None:
        self.period_ns = period_ns
        self._not_offered, self._config, self._new_epoch = not_offered, access, new_epoch
        self._commands = commands
        self._outbox = Outbox()
        self._arm = ArmControl(
            arm,
            period_ns,
            executor,
            stopwatch,
            lambda granted, message, text: self._requests.finish(granted, message, text),
            lambda error: self._outbox.output.errors.append(error),
        )
        self._reports = Reporter(self._arm, stopwatch, self._outbox)
        self._guard = FencingGuard()
        self._driver = DriverWatch(period_ns)
        self.access, dispatcher = self._new_access()
        self._requests = RequestHandler(dispatcher, commands, self._arm, reader or executor, self._outbox)

    def _new_access(self) -> tuple[Access, Dispatcher]:
        access = Access(self._new_epoch(), self._config)
        dispatcher = Dispatcher(access, lambda: self._arm.configuration, self._commands, self._not_offered)
        self._arm.complete_status = dispatcher.complete
        return access, dispatcher

    @property
    def motion(self) -> MotionExecutor:
        """The motion of the arm, to look at."""
        return self._arm.motion

    @property
    def planning(self) -> bool:
        """Whether a path is being planned."""
        return self._arm.busy

    @property
    def busy(self) -> bool:
        """Whether a path is being planned or a request read: then ``poll`` has something to find."""
        return self._arm.busy or self._requests.busy

    def take(self) -> ControllerOutput:
        """Everything that is to be sent since the last call."""
        self._reports.status()
        return self._outbox.take()

    # -- inputs -------------------------------------------------------------------------------------------------------

    def request(self, session: str, text: str, ticket: object) -> None:
        self._reports.status()
        self._requests.request(session, text, ticket)

    def stop_request(self, session: str, text: str, ticket: object) -> None:
        """A request on the query that is for stops only. It waits for nothing."""
        self._reports.status()
        self._requests.stop_request(session, text, ticket)

    def disconnected(self, session: str) -> None:
        """A client's connection is closed."""
        self._reports.status()
        self._requests.disconnected(session)

    def reset(self, why: str) -> None:
        """The arm's driver is gone or has restarted: nobody holds control, nothing moves, nothing is queued."""
        self._arm.cancel_plans(CrfCode.ServiceUnavailable, why)
        self._requests.overtake_all()
        held = self.access.holder(self._arm.now)
        to = self._requests.dispatcher.recipient(held.client) if held else ""
        epoch, stamp = self.access.epoch, self._arm.now
        self.access, self._requests.dispatcher = self._new_access()
        self._arm.reset((CrfCode.Disconnected,))
        self._arm.driver_fault = why
        self._reports.reset()
        if held is not None:
            info = ControlInfo(
                client=held.client, priority=held.priority, lease_id=held.lease_id, epoch=epoch, reason="restart"
            )
            self._outbox.output.events.append(MotionEvent(stamp=stamp, name="controlLost", to=to, info=info))

    def measured(self, state: ArmState) -> None:
        """Every state of the arm, in order, before the tick that may answer it."""
        self._arm.contact.watch.take(state)

    def await_plan(self, seconds: float) -> None:
        """Waits for the plan under way, at most so long."""
        self._arm.await_plan(seconds)

    def poll(self) -> None:
        """Between ticks: answers plans that are ready, so that a paused world answers too, and publishes what need not
        be ready before a command is sent."""
        self._reports.status()
        self._requests.take_in(lockstep=False)
        if self._arm.connected:
            self._arm.collect_plans()
            self._reports.path()
            self._arm.motion.prepare()

    def tick(self, state: ArmState, lockstep: bool) -> ArmCommand:
        """One control period. ``lockstep``: the driver waits for the command, so plans are waited for here."""
        with self._reports.watch.meter.measure():
            return self._answer(state, lockstep)

    def _answer(self, state: ArmState, lockstep: bool) -> ArmCommand:
        self._watch_driver(state)
        late = self._arm.begin_tick(state, lockstep)
        self._reports.watch.late_ticks += bool(late)
        now, requests = self._arm.now, self._requests
        missing = frozenset() if state.gripper is not None else GRIPPER_COMMANDS
        requests.dispatcher.not_offered = self._not_offered | missing
        requests.apply(requests.dispatcher.tick(state.stamp))
        requests.take_in(lockstep)
        commanded = self._arm.motion.q
        mode, values = self._arm.command(state, late)
        if (serial := self._arm.rested(state)) is not None:
            requests.apply(requests.dispatcher.at_rest(serial, now))
        if (contact := self._arm.contact.news()) is not None:
            self._outbox.output.events.append(MotionEvent(stamp=now, name="contact", info=contact))
        self._reports.ticked(requests.dispatcher, state, commanded)
        return self._fenced(state, mode, values)

    def _watch_driver(self, state: ArmState) -> None:
        """A driver that follows another controller, or nothing, does not move the arm as it is asked: then nobody holds
        control, and motion is refused until it obeys. The new epoch replaces whatever it followed."""
        fault = self._driver.fault(state, self.access.epoch)
        if fault:
            self.reset(fault)
            self._driver.reset()
            self._arm.obeyed = False
        elif not self._arm.obeyed and self._driver.obeys(state, self.access.epoch):
            self._arm.obeyed = True

    def _fenced(self, state: ArmState, mode: CommandMode, values: list[float]) -> ArmCommand:
        token = self.access.token
        self._guard.raise_to(token)
        if not self._guard.admit(token, state.stamp):
            raise AssertionError(f"a command of {token} after {self._guard.newest}")
        suction = bool(self._arm.suction)
        return ArmCommand(answers=state.stamp, mode=mode, values=tuple(values), token=token, suction=suction)
