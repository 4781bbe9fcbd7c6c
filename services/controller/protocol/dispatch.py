"""The front of the controller: a request's text in, its answer or an admitted command out.

Pure: it holds priority access, the memory of answers and the status streams, and is told the time. What moves the arm
is done by whoever takes the ``DispatchResult``: first its orders, then the admitted command, whose answer goes through
``finish``. Every request gets exactly one answer.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.base import Message
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import Expected, MotionStatus, RobotConfiguration
from rackhand.services.controller.access.access import Access
from rackhand.services.controller.access.types import (
    SECOND,
    AccessInput,
    AtRest,
    AuditEntry,
    Beat,
    Caller,
    Command,
    ControlEvent,
    Decision,
    Disconnected,
    Lock,
    Order,
    Outcome,
    StartBeat,
    Stop,
    StopBeat,
    Tick,
    Unlock,
)
from rackhand.services.controller.protocol.answers import (
    Answer,
    denied,
    encode,
    encode_id,
    error,
    event,
    lease_extras,
    refused,
    reply,
)
from rackhand.services.controller.protocol.checks import objection
from rackhand.services.controller.protocol.idempotence import Fresh, ReplyMemory
from rackhand.services.controller.protocol.parse import MAX_POINTS, Parsed, parse
from rackhand.services.controller.protocol.status_stream import StatusStream

_MOVING = (
    crf.AppendJointsPath, crf.AppendTaskPath, crf.SetVelocity, crf.SetTorque, crf.StartJointsControl,
    crf.StartTaskControl,
)  # fmt: skip
_AUDITED = (crf.SetGripper, crf.SetParameters, crf.SetProfileVelocity, crf.SetProfileAcceleration)
# What a retry must not do twice; everything else is carried out each time it comes.
_ONCE = (
    crf.AppendJointsPath, crf.AppendTaskPath, crf.UnlockControl, crf.ResumeControl, *_AUDITED, crf.StartJointsControl,
    crf.StartTaskControl,
)  # fmt: skip


@dataclass(frozen=True)
class Admitted:
    """A request that the controller has to answer: a granted command, or ``getStatus``."""

    request: crf.Request
    client: str
    verdict: Decision
    echo: dict[str, Any]
    key: tuple[str, bytes] | None = None


@dataclass(frozen=True)
class DispatchResult:
    """What follows from one happening. ``reply`` is the answer's JSON; without one either ``admitted`` brings it, or
    (``shared``, the key of that ``Admitted``) the answer of the same request, still being carried out, serves both."""

    reply: bytes | None = None
    admitted: Admitted | None = None
    shared: tuple[str, bytes] | None = None
    orders: tuple[Order, ...] = ()
    events: tuple[ControlEvent, ...] = ()
    audit: tuple[AuditEntry, ...] = ()


@dataclass
class _Context:
    """What belongs to the request at hand."""

    caller: Caller
    echo: dict[str, Any]
    session: str
    named: bool
    outcomes: list[Outcome] = field(default_factory=list)


class Dispatcher:
    """``now`` is always monotonic nanoseconds. ``session`` names the connection a request came through, and whoever
    knows it could speak for it; so a client without a name of its own goes by its session's ``alias``.
    ``not_offered``: commands this controller answers with 405; it may be set anew when more is known."""

    def __init__(
        self,
        access: Access,
        arm: RobotConfiguration,
        not_offered: frozenset[str] = frozenset(),
        max_points: int = MAX_POINTS,
        max_sessions: int = 1024,
    ) -> None:
        self.access = access
        self.arm = arm
        self.not_offered = not_offered
        self._max_points = max_points
        self._max_sessions = max_sessions
        self._memory = ReplyMemory()
        self._streams: dict[str, StatusStream] = {}
        self._sessions: OrderedDict[str, str] = OrderedDict()

    # -- what happens -------------------------------------------------------------------------------------------------

    def read(self, text: bytes | str) -> Parsed:
        """What a request says. Needs nothing that changes, so it may be done beside."""
        return parse(text, self.arm.joint_space_degree_of_freedom, self._max_points)

    def request(self, session: str, text: bytes | str, now: int, parsed: Parsed | None = None) -> DispatchResult:
        """``parsed``: the text as it was read, if it was."""
        parsed = parsed or self.read(text)
        if isinstance(parsed.result, Answer):
            return DispatchResult(encode(parsed.result, parsed.echo))
        request = parsed.result
        client = alias(session) if request.client is None else request.client
        self._remember_session(client, session)
        begun = self._memory.begin(client, parsed.echo, text, isinstance(request, _ONCE))
        if not isinstance(begun, Fresh):
            return DispatchResult(begun.answer, shared=None if begun.answer else begun.key)
        context = _Context(_caller(client, request, parsed.echo), parsed.echo, session, request.client is not None)
        result = self._answer(request, context, now)
        if isinstance(result, Answer):
            message = encode(result, parsed.echo)
            self._memory.finish(begun.key, message, _took_effect(result))
            return _turn(context.outcomes, reply_=message)
        return _turn(context.outcomes, admitted=Admitted(request, client, result, parsed.echo, begun.key))

    def finish(self, admitted: Admitted, result: Message, text: str = "") -> bytes:
        """The answer of an admitted request: an ``Expected`` for commands, the status for ``getStatus``."""
        extras = lease_extras(admitted.verdict) if admitted.request.client is not None else {}
        answer = reply(admitted.request.command, result, text, **extras)
        message = encode(answer, admitted.echo)
        self._memory.finish(admitted.key, message, _took_effect(answer))
        return message

    def tick(self, now: int) -> DispatchResult:
        return _turn([self.access.handle(Tick(), now)])

    def at_rest(self, serial: int, now: int) -> DispatchResult:
        return _turn([self.access.handle(AtRest(serial), now)])

    def disconnected(self, session: str, now: int) -> DispatchResult:
        """A connection is gone. A client that has come back through another one is still there."""
        self._streams.pop(session, None)
        gone = [client for client, last in self._sessions.items() if last == session]
        for client in gone:
            del self._sessions[client]
        if (nameless := alias(session)) not in gone:
            gone.append(nameless)  # forgotten for newer ones, perhaps
        return _turn([self.access.handle(Disconnected(client), now) for client in gone])

    @property
    def streams(self) -> bool:
        """Whether anybody is streamed to."""
        return bool(self._streams)

    def recipient(self, client: str) -> str:
        """Whom an event to ``client`` is for: a client with a name, or the session of one without."""
        return self._sessions.get(client, client) if client.startswith(crf.ALIAS_MARK) else client

    def due(self, status: MotionStatus, now: int) -> list[tuple[str, bytes]]:
        """The stream events to send now, by session."""
        sessions = [session for session, stream in self._streams.items() if stream.due(status, now)]
        message = event("streamStatus", status) if sessions else b""
        return [(session, message) for session in sessions]

    def complete(self, status: MotionStatus, now: int) -> MotionStatus:
        """``status`` with what priority access knows filled in."""
        access = self.access
        known = {
            "priority_under_control": access.priority_under_control,
            "epoch": access.epoch,
            "holder": access.holder(now),
            "stopped_by": access.stopped_by,
        }
        return status.model_copy(update=known)

    # -- answers ------------------------------------------------------------------------------------------------------

    def _answer(self, request: crf.Request, context: _Context, now: int) -> Answer | Decision:
        """The answer, or the verdict under which the controller is to find it."""

        def handle(happened: AccessInput) -> Decision:
            context.outcomes.append(self.access.handle(happened, now))
            return context.outcomes[-1].verdict

        match request:
            case crf.GetStatus():
                return Decision(True)
            case crf.GetConfiguration():
                return reply(request.command, self.arm)
            case crf.StartStreamStatus() | crf.StopStreamStatus():
                return self._stream(request, context.session, now)
            case crf.LockControl():
                verdict = handle(_lock(request, context.caller))
                return reply(request.command, verdict.ok, verdict.text, **_extras(context, verdict))
            case crf.UnlockControl():
                verdict = handle(Unlock(context.caller, request.priority))
                return reply(request.command, verdict.ok, verdict.text)
            case crf.SoftStop() | crf.HardStop():
                return self._stop(request, context, handle)
            case crf.StartHeartbeat() | crf.Heartbeat() | crf.StopHeartbeat():
                return _heartbeat(request, context.caller, handle)
            case crf.ControlRequest():
                return self._control(request, context, handle)
        raise AssertionError(f"no answer for {type(request).__name__}")

    def _control(
        self, request: crf.ControlRequest, context: _Context, handle: Callable[[AccessInput], Decision]
    ) -> Answer | Decision:
        command = _command(request, context.caller)
        handle(Tick())
        if self.access.refusal(command) is None:
            # Judged before control is taken, so that a useless command neither pre-empts nor refreshes.
            if request.command in self.not_offered:
                return refused(request.command, CrfCode.MethodNotAllowed, text="this controller does not offer it")
            if wrong := objection(request, self.arm):
                return refused(request.command, CrfCode.BadRequest, text=wrong)
        verdict = handle(command)
        if not verdict.ok:
            return denied(request.command, verdict)
        if isinstance(request, crf.ResumeControl):
            return reply(request.command, Expected[bool].of(True), **_extras(context, verdict))
        return verdict

    def _stop(
        self, request: crf.SoftStop | crf.HardStop, context: _Context, handle: Callable[[AccessInput], Decision]
    ) -> Answer:
        if request.priority is None and self.access.config.strict_crf:
            return error(CrfCode.BadRequest, "priority is missing")
        verdict = handle(Stop(context.caller, request.command, request.priority))
        return reply(request.command, Expected[bool].of(True)) if verdict.ok else denied(request.command, verdict)

    def _stream(self, request: crf.StartStreamStatus | crf.StopStreamStatus, session: str, now: int) -> Answer:
        """CRF leaves these unanswered on success; a ``true`` does its clients no harm and leaves nobody waiting."""
        active = self._streams.get(session)
        if isinstance(request, crf.StopStreamStatus):
            if active is None:
                return error("Stream was not active")
            del self._streams[session]
        elif active is not None:
            active.change(request.frequency, request.mode)
        elif len(self._streams) >= self._max_sessions:
            return error(CrfCode.ServiceUnavailable, f"{len(self._streams)} streams are active")
        else:
            self._streams[session] = StatusStream(request.frequency, request.mode, now)
        return reply(request.command, True)

    def _remember_session(self, client: str, session: str) -> None:
        self._sessions[client] = session
        self._sessions.move_to_end(client)
        if len(self._sessions) > self._max_sessions:
            self._sessions.popitem(last=False)


def alias(session: str) -> str:
    """What a client without a name is called where others see it. It leads nobody back to the session."""
    return crf.ALIAS_MARK + hashlib.blake2s(session.encode(errors="surrogatepass"), digest_size=8).hexdigest()


def _heartbeat(
    request: crf.StartHeartbeat | crf.Heartbeat | crf.StopHeartbeat,
    caller: Caller,
    handle: Callable[[AccessInput], Decision],
) -> Answer:
    match request:
        case crf.StartHeartbeat():
            verdict = handle(StartBeat(caller, int(request.period * SECOND)))
        case crf.Heartbeat():
            verdict = handle(Beat(caller))
        case crf.StopHeartbeat():
            verdict = handle(StopBeat(caller))
    if verdict.ok:
        return reply(request.command, True)
    return error(verdict.text if verdict.code == CrfCode.BadRequest else int(verdict.code), verdict.text)


def _lock(request: crf.LockControl, caller: Caller) -> Lock:
    keep_alive = None if request.keep_alive is None else int(min(request.keep_alive, 1e6) * SECOND)
    return Lock(caller, request.priority, keep_alive, request.on_loss, request.takeover, request.force)


def _command(request: crf.ControlRequest, caller: Caller) -> Command:
    return Command(
        caller,
        request.command,
        request.priority,
        moves=isinstance(request, _MOVING),
        resumes=isinstance(request, crf.ResumeControl),
        audited=isinstance(request, _AUDITED),
        epoch=request.epoch,
        lease=request.lease_id,
        takeover=request.takeover,
    )


def _caller(client: str, request: crf.Request, echo: dict[str, Any]) -> Caller:
    user = request.user
    name, role = (user.name[:128], user.role[:128]) if user else ("", "")
    return Caller(client, name, role, encode_id(echo)[:64].decode(errors="replace"))


def _extras(context: _Context, verdict: Decision) -> dict[str, Any]:
    """Stock clients get CRF's reply to the letter; who gives its name is told its lease."""
    return lease_extras(verdict) if context.named else {}


def _took_effect(answer: Answer) -> bool:
    message = answer.message
    return message is True or (isinstance(message, dict) and message.get("value") is True)


def _turn(outcomes: list[Outcome], reply_: bytes | None = None, admitted: Admitted | None = None) -> DispatchResult:
    return DispatchResult(
        reply=reply_,
        admitted=admitted,
        orders=tuple(order for outcome in outcomes for order in outcome.orders),
        events=tuple(happened for outcome in outcomes for happened in outcome.events),
        audit=tuple(entry for outcome in outcomes for entry in outcome.audit),
    )
