"""The protocol layer: a request's text in, its answer or a granted command out.

Pure: it holds priority access, the memory of answers and the status streams, and gets the time as an argument. Commands
that act on the arm are executed by the caller of ``request``: first the motion effects of the ``DispatchResult``, then
the granted command, whose answer is made by ``finish``. Every request gets exactly one answer.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.base import Message
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import MotionStatus, RobotConfiguration
from rackhand.services.controller.access.access import Access
from rackhand.services.controller.access.types import (
    AtRest,
    Caller,
    Command,
    Decision,
    Disconnected,
    Effects,
    Outcome,
    Tick,
)
from rackhand.services.controller.commands.spec import CommandSpec, CommandTable, GrantedCommand, OnAccess
from rackhand.services.controller.protocol.answers import (
    Answer,
    denied,
    encode,
    encode_id,
    event,
    lease_extras,
    refused,
    reply,
)
from rackhand.services.controller.protocol.context import RequestContext
from rackhand.services.controller.protocol.idempotence import Fresh, ReplyMemory
from rackhand.services.controller.protocol.parse import MAX_POINTS, Parsed, parse
from rackhand.services.controller.protocol.sessions import Sessions, alias
from rackhand.services.controller.protocol.status_stream import StatusStreams

MAX_SESSIONS = 1024


@dataclass(frozen=True)
class DispatchResult(Effects):
    """What follows from one request. ``reply`` is the answer's JSON. Without one either ``granted`` is to be executed,
    or (``shared``, the key of that ``GrantedCommand``) the same request is being executed and its answer serves both.
    """

    reply: bytes | None = None
    granted: GrantedCommand | None = None
    shared: tuple[str, bytes] | None = None


class Dispatcher:
    """``now`` is always monotonic nanoseconds; ``session`` names the connection of a request (see ``Sessions``).

    ``arm`` gives the configuration of the arm as it is now. ``not_offered``: commands that are answered with 405; it
    may be assigned when more is known.
    """

    def __init__(
        self,
        access: Access,
        arm: Callable[[], RobotConfiguration],
        commands: CommandTable,
        not_offered: frozenset[str] = frozenset(),
        max_points: int = MAX_POINTS,
    ) -> None:
        self.access = access
        self.not_offered = not_offered
        self._arm, self._commands = arm, commands
        self._max_points = max_points
        self._memory = ReplyMemory(access.config.retry_ns)
        self._streams = StatusStreams(MAX_SESSIONS)
        self._sessions = Sessions(MAX_SESSIONS)

    # -- inputs -------------------------------------------------------------------------------------------------------

    def read(self, text: bytes | str) -> Parsed:
        """The typed request. It depends on nothing that changes, so another thread may do it."""
        return parse(text, self._arm().joint_space_degree_of_freedom, self._commands, self._max_points)

    def request(
        self, session: str, text: bytes | str, now: int, parsed: Parsed | None = None, ticket: object = None
    ) -> DispatchResult:
        """``parsed``: what ``read`` has made of the text, if it has. ``ticket`` is kept in a granted command."""
        parsed = parsed or self.read(text)
        if isinstance(parsed.result, Answer):
            return DispatchResult(reply=encode(parsed.result, parsed.echo))
        request = parsed.result
        spec = self._commands.of(request)
        client = alias(session) if request.client is None else request.client
        self._sessions.remember(client, session)
        begun = self._memory.begin(client, parsed.echo, text, spec.once, now)
        if not isinstance(begun, Fresh):
            return DispatchResult(reply=begun.answer, shared=None if begun.answer else begun.key)
        caller = _caller(client, request, parsed.echo)
        named = request.client is not None
        context = RequestContext(self.access, self._streams, self._arm(), caller, session, named, now)
        result = self._answer(spec, request, context)
        if isinstance(result, Answer):
            message = encode(result, parsed.echo)
            self._memory.finish(begun.key, message, _took_effect(result), now)
            return _result(context.outcomes, answer=message)
        granted = GrantedCommand(request, client, result, parsed.echo, begun.key, ticket)
        return _result(context.outcomes, granted=granted)

    def finish(self, granted: GrantedCommand, message: Message, now: int, text: str = "") -> bytes:
        """The answer of a granted command: an ``Expected``, or the status for ``getStatus``."""
        extras = lease_extras(granted.decision) if granted.request.client is not None else {}
        answer = reply(granted.request.command, message, text, **extras)
        encoded = encode(answer, granted.echo)
        self._memory.finish(granted.key, encoded, _took_effect(answer), now)
        return encoded

    def tick(self, now: int) -> Effects:
        """Time has passed: locks and heartbeats may have expired."""
        return self.access.handle(Tick(), now)

    def at_rest(self, serial: int, now: int) -> Effects:
        """The arm is at rest with an empty queue, everything up to ``serial`` done."""
        return self.access.handle(AtRest(serial), now)

    def disconnected(self, session: str, now: int) -> Effects:
        """A connection is closed."""
        self._streams.stop(session)
        gone = self._sessions.forget(session)
        return Effects.joined([self.access.handle(Disconnected(client), now) for client in gone])

    # -- status -------------------------------------------------------------------------------------------------------

    @property
    def streaming(self) -> bool:
        """Whether any session has a status stream."""
        return bool(self._streams)

    def recipient(self, client: str) -> str:
        """Where an event to ``client`` goes: a client with a name, or the session of one without."""
        return self._sessions.recipient(client)

    def due(self, status: MotionStatus, now: int) -> list[tuple[str, bytes]]:
        """The stream events to send now, by session."""
        sessions = self._streams.due(status, now)
        message = event("streamStatus", status) if sessions else b""
        return [(session, message) for session in sessions]

    def complete(self, status: MotionStatus, now: int) -> MotionStatus:
        """``status`` with the fields of priority access filled in."""
        access = self.access
        known = {
            "priority_under_control": access.priority_under_control,
            "epoch": access.epoch,
            "holder": access.holder(now),
            "stopped_by": access.stopped_by,
        }
        return status.model_copy(update=known)

    # -- answers ------------------------------------------------------------------------------------------------------

    def _answer(self, spec: CommandSpec[Any], request: crf.Request, context: RequestContext) -> Answer | Decision:
        """The answer, or the decision under which the command is to be executed on the arm."""
        if isinstance(spec.execute, OnAccess):
            answer: Answer = spec.execute.run(request, context)
            return answer
        if not isinstance(request, crf.ControlRequest):
            return Decision(True)
        return self._grant(spec, request, context)

    def _grant(self, spec: CommandSpec[Any], request: crf.ControlRequest, context: RequestContext) -> Answer | Decision:
        command = _command(spec, request, context.caller)
        context.handle(Tick())
        if self.access.refusal(command) is None:
            # Checked before control is taken, so that a useless command neither pre-empts nor refreshes.
            if request.command in self.not_offered:
                return refused(request.command, CrfCode.MethodNotAllowed, text="this controller does not offer it")
            if wrong := spec.check(request, context.arm):
                return refused(request.command, CrfCode.BadRequest, text=wrong)
        decision = context.handle(command)
        return decision if decision.ok else denied(request.command, decision)


def _command(spec: CommandSpec[Any], request: crf.ControlRequest, caller: Caller) -> Command:
    return Command(
        caller,
        request.command,
        request.priority,
        moves=spec.moves,
        resumes=spec.resumes,
        audited=spec.audited,
        epoch=request.epoch,
        lease=request.lease_id,
        takeover=request.takeover,
    )


def _caller(client: str, request: crf.Request, echo: dict[str, Any]) -> Caller:
    user = request.user
    name, role = (user.name[:128], user.role[:128]) if user else ("", "")
    return Caller(client, name, role, encode_id(echo)[:64].decode(errors="replace"))


def _took_effect(answer: Answer) -> bool:
    message = answer.message
    return message is True or (isinstance(message, dict) and message.get("value") is True)


def _result(
    outcomes: list[Outcome], answer: bytes | None = None, granted: GrantedCommand | None = None
) -> DispatchResult:
    effects = Effects.joined(outcomes)
    return DispatchResult(effects.motion, effects.events, effects.audit, answer, granted)
