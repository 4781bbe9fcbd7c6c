"""Requests of all sessions: each gets one answer, under the ticket that it came with."""

from __future__ import annotations

from concurrent.futures import Executor

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.base import Message
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import MotionEvent
from rackhand.services.controller.access.types import Effects, StopMotion
from rackhand.services.controller.arm_control import ArmControl
from rackhand.services.controller.commands.spec import CommandTable, GrantedCommand, OnArm
from rackhand.services.controller.outputs import Outbox
from rackhand.services.controller.protocol.answers import Answer, encode, error
from rackhand.services.controller.protocol.dispatch import Dispatcher
from rackhand.services.controller.protocol.parse import Parsed
from rackhand.services.controller.protocol.reading import LONG, ParseQueue, Reading

_FAILED = "the controller failed to answer; see its log"


class RequestHandler:
    """Executes requests on ``arm``. ``dispatcher`` is replaced when priority access is reset."""

    def __init__(
        self, dispatcher: Dispatcher, commands: CommandTable, arm: ArmControl, reader: Executor, outbox: Outbox
    ) -> None:
        self.dispatcher = dispatcher
        self._commands, self._arm, self._outbox = commands, arm, outbox
        self._reading = ParseQueue(reader, lambda text: self.dispatcher.read(text))
        self._shared: dict[tuple[str, bytes], list[object]] = {}

    @property
    def busy(self) -> bool:
        """Whether a long request is being read."""
        return self._reading.busy

    def request(self, session: str, text: str, ticket: object) -> None:
        if not self._reading.wanted(session, text):
            self._request(session, text, ticket, None)
        elif self._reading.full:
            self._reply(ticket, error(CrfCode.ServiceUnavailable, "too many long requests are being parsed"))
        else:
            self._reading.take(session, text, ticket)

    def stop_request(self, session: str, text: str, ticket: object) -> None:
        """A request on the query that is for stops only: it never waits behind another request."""
        if len(text) > LONG:
            wrong = f"{len(text)} characters, a stop has at most {LONG}"
            self._reply(ticket, error("Not valid json format", wrong))
            return
        parsed = self.dispatcher.read(text)
        if isinstance(parsed.result, crf.Request) and not isinstance(parsed.result, crf.SoftStop | crf.HardStop):
            refusal = error(f"Unknown command: {parsed.result.command}", "only softStop and hardStop are accepted here")
            self._reply(ticket, refusal, parsed)
        else:
            self._request(session, text, ticket, parsed)

    def disconnected(self, session: str) -> None:
        """A client's connection is closed."""
        self._reading.overtake(session)
        self.apply(self.dispatcher.disconnected(session, self._arm.now))

    def overtake_all(self) -> None:
        """What is being read now must not move the arm any more."""
        self._reading.overtake()

    def take_in(self, lockstep: bool) -> None:
        """Executes long requests that are read by now; ``lockstep``: waits for all of them."""
        for reading in self._reading.collect(lockstep):
            try:
                self._take_in(reading)
            except Exception as failure:  # no other request, and no tick, fails with it
                self._outbox.output.errors.append(failure)
                self._reply(reading.ticket, error(CrfCode.InternalServerError, _FAILED))

    def apply(self, effects: Effects) -> None:
        """Carries out what priority access has decided, and publishes its events."""
        for effect in effects.motion:
            if isinstance(effect, StopMotion):
                self._reading.overtake()
            self._arm.apply(effect)
        output = self._outbox.output
        for event in effects.events:
            to = self.dispatcher.recipient(event.to)
            output.events.append(MotionEvent(stamp=self._arm.now, name=event.name, to=to, info=event.info))
        output.audit.extend(effects.audit)

    def finish(self, granted: GrantedCommand, message: Message, text: str = "") -> None:
        """Answers a granted command, and the retries that came meanwhile."""
        answer = self.dispatcher.finish(granted, message, self._arm.now, text).decode()
        tickets = [granted.ticket, *(self._shared.pop(granted.key, []) if granted.key else [])]
        self._outbox.output.replies.extend((each, answer) for each in tickets)

    def _take_in(self, reading: Reading) -> None:
        parsed = reading.future.result() if reading.future else self.dispatcher.read(reading.text)
        if reading.overtaken and isinstance(parsed.result, crf.ControlRequest):
            self._reply(reading.ticket, error(CrfCode.Conflict, "a stop arrived while it was parsed"), parsed)
        else:
            self._request(reading.session, reading.text, reading.ticket, parsed)

    def _request(self, session: str, text: str, ticket: object, parsed: Parsed | None) -> None:
        result = self.dispatcher.request(session, text, self._arm.now, parsed, ticket)
        self.apply(result)
        if result.reply is not None:
            self._outbox.output.replies.append((ticket, result.reply.decode()))
        elif result.shared is not None:
            self._shared.setdefault(result.shared, []).append(ticket)
        elif result.granted is not None:
            self._execute(result.granted)

    def _execute(self, granted: GrantedCommand) -> None:
        execute = self._commands.of(granted.request).execute
        assert isinstance(execute, OnArm), "the dispatcher grants nothing else"
        self._arm.started(granted)
        result = execute.run(granted.request, self._arm, granted)
        if result is not None:
            self.finish(granted, result.message, result.text)

    def _reply(self, ticket: object, answer: Answer, parsed: Parsed | None = None) -> None:
        text = encode(answer, parsed.echo if parsed else None).decode()
        self._outbox.output.replies.append((ticket, text))
