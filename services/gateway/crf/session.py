"""One client's CRF session, whatever carries it: requests go to the controller, answers, events and status come back.

Nothing here waits for a client. What is asked but not yet sent, and what is answered but not yet read, is bounded:
beyond the first bound a request is answered 503 at once, beyond the second the session ends.
"""

from __future__ import annotations

import asyncio
import secrets
from collections import OrderedDict, deque
from collections.abc import Awaitable, Callable, Coroutine
from dataclasses import dataclass
from typing import Any

from rackhand.bus import BusError, Refused
from rackhand.schemas import topics
from rackhand.schemas.codec import MalformedMessage
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import CONNECTION, CrfAnswer, CrfCall, MotionEvent
from rackhand.schemas.refusal import RefusalCode
from rackhand.services.gateway.crf.text import Envelope, error_text, read_envelope, to_text, unreadable
from rackhand.services.gateway.ws.broadcast import Outbox

MAX_IN_FLIGHT = 16  # of one session; the controller's queue, for all, is 256
MAX_WAITING = 256
MAX_WAITING_CHARACTERS = 8 * 1024 * 1024
MAX_NAMES = 16

MotionQuery = topics.Query[CrfCall, CrfAnswer]
Ask = Callable[[MotionQuery, CrfCall], Awaitable[CrfAnswer]]


@dataclass(frozen=True)
class Waiting:
    """A request on its way."""

    envelope: Envelope
    text: str


class Lane:
    """Requests carried in order, a few at a time; each answer comes when it is ready."""

    def __init__(self, carry: Callable[[Waiting], Coroutine[Any, Any, None]]) -> None:
        self._carry = carry
        self._waiting: deque[Waiting] = deque()
        self._running: set[asyncio.Task[None]] = set()
        self._size = 0

    def offer(self, request: Waiting) -> bool:
        """False, and nothing taken, where too much is waiting."""
        if len(self._waiting) >= MAX_WAITING or self._size + len(request.text) > MAX_WAITING_CHARACTERS:
            return False
        self._waiting.append(request)
        self._size += len(request.text)
        self._start()
        return True

    def clear(self) -> list[Waiting]:
        """Take out what is not sent yet."""
        dropped, self._size = list(self._waiting), 0
        self._waiting.clear()
        return dropped

    def close(self) -> list[asyncio.Task[None]]:
        self.clear()
        for task in self._running:
            task.cancel()
        return list(self._running)

    def _start(self) -> None:
        while self._waiting and len(self._running) < MAX_IN_FLIGHT:
            request = self._waiting.popleft()
            self._size -= len(request.text)
            task = asyncio.get_running_loop().create_task(self._carry(request))
            self._running.add(task)
            task.add_done_callback(self._ended)

    def _ended(self, task: asyncio.Task[None]) -> None:
        self._running.discard(task)
        self._start()


class Session:
    """``name`` is the client's name on the bus; nobody can guess it. ``ended`` is set when the client reads too
    slowly to be kept."""

    def __init__(self, ask: Ask) -> None:
        self.name = CONNECTION + secrets.token_urlsafe(24)
        self.outbox = Outbox()
        self.ended = asyncio.Event()
        self._ask = ask
        self._names: OrderedDict[str, None] = OrderedDict()
        self._commands = Lane(lambda request: self._carry(topics.MOTION, request))
        self._stops = Lane(lambda request: self._carry(topics.MOTION_STOP, request))

    # -- from the client ----------------------------------------------------------------------------------------------

    def take(self, raw: str | bytes) -> None:
        """One request. It gets exactly one answer, while the session lasts."""
        text = to_text(raw)
        if text is None:
            self.answer(unreadable(raw))
            return
        request = Waiting(read_envelope(text), text)
        if request.envelope.is_stop:
            self._overtake()
        self._remember_name(request.envelope.client)
        if not (self._stops if request.envelope.is_stop else self._commands).offer(request):
            why = f"{MAX_WAITING} requests of this connection are waiting"
            self.answer(error_text(CrfCode.ServiceUnavailable, why, request.envelope))

    def answer(self, text: str) -> None:
        if not self.outbox.offer(text):
            self.ended.set()

    def _overtake(self) -> None:
        """A stop waits for nothing; what was asked before it must not move the arm after it."""
        for request in self._commands.clear():
            self.answer(error_text(CrfCode.Conflict, "not sent: a stop arrived first", request.envelope))

    async def _carry(self, query: MotionQuery, request: Waiting) -> None:
        envelope = request.envelope
        try:
            answer = (await self._ask(query, CrfCall(session=self.name, text=request.text))).text
        except (BusError, MalformedMessage) as error:
            self.answer(error_text(failure_code(error), str(error), envelope))
            return
        self.answer(answer)

    def _remember_name(self, name: Any) -> None:
        if isinstance(name, str) and 0 < len(name) <= 128:
            self._names[name] = None
            self._names.move_to_end(name)
            if len(self._names) > MAX_NAMES:
                self._names.popitem(last=False)

    # -- to the client ------------------------------------------------------------------------------------------------

    def tell_status(self, text: str) -> None:
        self.outbox.stream("streamStatus", text)

    def tell_event(self, event: MotionEvent, text: str) -> None:
        if event.to in ("", self.name) or event.to in self._names:
            self.outbox.event("event", text)

    # -- its life -----------------------------------------------------------------------------------------------------

    async def serve(self, receiving: Coroutine[Any, Any, None], send: Callable[[str], Awaitable[None]]) -> None:
        """Until ``receiving`` (which calls ``take``) ends, ``send`` fails, or the client reads too slowly."""

        async def sending() -> None:
            while True:
                await send(await self.outbox.next())

        loop = asyncio.get_running_loop()
        tasks = [loop.create_task(work) for work in (receiving, sending(), _wait(self.ended))]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            calls = [*self._commands.close(), *self._stops.close()]
            outcomes = await asyncio.gather(*tasks, return_exceptions=True)
            await asyncio.gather(*calls, return_exceptions=True)
        for outcome in outcomes:
            if isinstance(outcome, Exception) and not isinstance(outcome, ConnectionError):
                raise outcome


def failure_code(error: BusError | MalformedMessage) -> CrfCode:
    """What the bus's refusals and silences are in CRF."""
    if isinstance(error, MalformedMessage) or (
        isinstance(error, Refused) and error.code is not RefusalCode.UNAVAILABLE
    ):
        return CrfCode.InternalServerError
    return CrfCode.ServiceUnavailable


async def _wait(event: asyncio.Event) -> None:
    await event.wait()
