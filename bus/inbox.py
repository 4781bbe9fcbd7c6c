"""One queue for everything a service receives, so that its main thread is one loop over events.

Typed use: ``inbox.on(topic, handler)``, then ``inbox.dispatch(event)`` for each event that ``get`` returns.
"""

from __future__ import annotations

import asyncio
import queue
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import zenoh

from rackhand.bus.attached import stay_attached
from rackhand.bus.handlers import Handlers, Posted, Presence
from rackhand.bus.requests import Request, refuse
from rackhand.bus.samples import Malformed, Sample, parse
from rackhand.schemas.base import Message
from rackhand.schemas.codec import MalformedMessage, codec_for
from rackhand.schemas.refusal import RefusalCode
from rackhand.schemas.service import ALIVE_EVERYWHERE, ServiceId
from rackhand.schemas.topics import Qos, Query, Topic

if TYPE_CHECKING:
    from rackhand.bus.session import Bus

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)
T = TypeVar("T")

# How many unread samples of one subscription are kept; beyond it the oldest go, counted.
DEPTH = {Qos.STREAM: 16, Qos.COMMAND: 64, Qos.EVENT: 1024, Qos.LATCHED: 16}
MAX_REQUESTS = 256
MAX_OVERTAKES = 16


Event = Sample | Request[Any, Any] | Presence | Posted


class _Source:
    """One subscription's unread items. The inbox's queue has one token for each of them.

    ``low_priority``: it is read when nothing else waits.
    """

    def __init__(self, depth: int | None, decode: Callable[[Any], Event | None], low_priority: bool = False) -> None:
        self.low_priority = low_priority
        self.items: deque[Any] = deque(maxlen=depth)
        self.lock = threading.Lock()
        self.decode = decode
        self.dropped = 0

    def push(self, item: Any) -> bool:
        """True if the item needs a token: it did not push out an older one."""
        with self.lock:
            full = len(self.items) == self.items.maxlen
            self.dropped += full
            self.items.append(item)
            return not full

    def pop(self) -> Any:
        with self.lock:
            return self.items.popleft()


class Inbox:
    """Everything that was subscribed to, in order of arrival. One reader; iteration ends when the bus stops.

    Requests served as ``low_priority`` are read when nothing else waits, so that a flood of them delays nothing; after
    ``MAX_OVERTAKES`` other events one of them is read all the same.

    Zenoh's threads only put raw samples here: decoding, and so every cost and every error, is in the reader's thread,
    and a slow reader never holds up another topic.
    """

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._tokens: queue.SimpleQueue[_Source | None] = queue.SimpleQueue()
        self._sources: list[_Source] = []
        self._overtakes = 0
        self._passed: deque[_Source] = deque()  # low_priority ones whose token brought something else
        self._handles: list[Any] = []
        self._alive: dict[str, bool] = {}
        self._wake: Callable[[], object] | None = None
        self._stopped = False
        self._handlers = Handlers()
        self.received = 0
        self.malformed = Malformed()

    @property
    def dropped(self) -> int:
        """Samples that newer ones pushed out before they were read."""
        return sum(source.dropped for source in self._sources)

    # -- typed handlers ----------------------------------------------------------------------------------------------

    def on(
        self, topic: Topic[M], handler: Callable[[str, M], None], robot: str = "*", depth: int | None = None
    ) -> Inbox:
        """Subscribe; ``dispatch`` calls ``handler(robot, message)``. Raises ``ValueError`` for another handler."""
        self._handlers.on(topic, handler)
        return self.subscribe(topic, robot, depth)

    def on_request(
        self, query: Query[Q, R], handler: Callable[[Request[Q, R]], None], robot: str, low_priority: bool = False
    ) -> Inbox:
        """Serve a query; ``dispatch`` calls ``handler(request)``, which replies or refuses, now or later."""
        self._handlers.on_request(query, handler)
        return self.serve(query, robot, low_priority)

    def on_presence(self, handler: Callable[[ServiceId, bool], None]) -> Inbox:
        """Watch liveliness tokens; ``dispatch`` calls ``handler(service, alive)``."""
        self._handlers.on_presence(handler)
        return self.watch_services()

    def poster(self, handler: Callable[[T], None]) -> Callable[[T], None]:
        """A function that any thread may call with an item: ``dispatch`` then calls ``handler(item)`` in the reader's
        thread. Nothing that is posted is dropped."""
        source = self._add_source(None, lambda item: Posted(handler, item))
        return lambda item: self._push(source, item)

    def dispatch(self, event: Event) -> None:
        """Bring an event to its handler. What the handler raises passes."""
        self._handlers.dispatch(event)

    # -- subscriptions -----------------------------------------------------------------------------------------------

    def subscribe(self, topic: Topic[Any], robot: str = "*", depth: int | None = None) -> Inbox:
        codec = codec_for(topic.model)

        def decode(raw: zenoh.Sample) -> Event | None:
            return parse(topic, codec, raw, self.malformed)

        source = self._add_source(depth or DEPTH[topic.qos], decode)
        key = topic.key_for(robot)
        self._handles.append(self._bus.declare_subscriber(key, topic.qos, self._pusher(source)))
        return self

    def serve(self, query: Query[Any, Any], robot: str, low_priority: bool = False) -> Inbox:
        codec = codec_for(query.request)

        def decode(pending: zenoh.Query) -> Event | None:
            payload = pending.payload.to_bytes() if pending.payload is not None else b""
            try:
                message = codec.loads(payload, str(pending.encoding) if pending.encoding is not None else None)
            except MalformedMessage as error:
                refuse(pending, RefusalCode.MALFORMED, str(error))
                self.malformed.count(query.name, error)
                return None
            return Request(query, robot, message, pending)

        source = self._add_source(MAX_REQUESTS, decode, low_priority)
        push = self._pusher(source)

        def push_or_refuse(pending: zenoh.Query) -> None:
            if len(source.items) >= MAX_REQUESTS:
                return refuse(pending, RefusalCode.UNAVAILABLE, f"more than {MAX_REQUESTS} requests are waiting")
            return push(pending)

        self._handles.append(self._bus.declare_queryable(query.key_for(robot), push_or_refuse))
        return self

    def watch_services(self) -> Inbox:
        """Receive a ``Presence`` for every liveliness token that appears or disappears, and for those already there."""

        def decode(change: tuple[str, bool]) -> Event | None:
            key, alive = change
            if self._alive.get(key, False) == alive:  # a token may be reported twice
                return None
            self._alive[key] = alive
            return Presence(ServiceId.from_key(key), alive)

        source = self._add_source(1024, decode)
        push = self._pusher(source)

        def changed(sample: zenoh.Sample) -> None:
            push((str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT))

        self._handles.append(self._bus.declare_liveliness_subscriber(ALIVE_EVERYWHERE, changed))
        return self

    def get(self, timeout: float | None = None) -> Event | None:
        """The next event; None after ``timeout`` seconds of wall time without one, or when the bus stops."""
        deadline = None if timeout is None else time.monotonic() + timeout
        while not self._stopped:
            try:
                source = self._tokens.get(timeout=None if deadline is None else max(0.0, deadline - time.monotonic()))
            except queue.Empty:
                return None
            if source is None:
                self._stopped = True
            elif (event := self._read(source)) is not None:
                self.received += 1
                return event
        return None

    def _read(self, source: _Source) -> Event | None:
        """The next item; ``source`` is the one of the token read. A token is valid for any item: there are as many of
        them as of items, whatever the order."""
        if source.low_priority:
            self._passed.append(source)
        urgent = source if source.items and not source.low_priority else self._urgent()
        if urgent is None or (self._passed and self._overtakes >= MAX_OVERTAKES):
            source, self._overtakes = self._passed.popleft(), 0
        else:
            source, self._overtakes = urgent, self._overtakes + 1 if self._passed else 0
        return source.decode(source.pop())

    def _urgent(self) -> _Source | None:
        return next((source for source in self._sources if source.items and not source.low_priority), None)

    def __iter__(self) -> Iterator[Event]:
        return iter(self.get, None)  # holds no event: a request its reader has dropped is dropped

    async def stream(self) -> AsyncIterator[Event]:
        """The asyncio twin of iterating: many arrivals wake the loop once."""
        loop, arrived = asyncio.get_running_loop(), asyncio.Event()
        self._wake = lambda: loop.call_soon_threadsafe(arrived.set)
        try:
            while not self._stopped:
                arrived.clear()
                while (event := self.get(timeout=0)) is not None:
                    yield event
                if not self._stopped:
                    await arrived.wait()
        finally:
            self._wake = None

    def stop(self) -> None:
        """End iteration. May be called from a signal handler and from any thread."""
        self._tokens.put(None)
        self._wake_reader()

    def close(self) -> None:
        self.stop()
        for handle in self._handles:
            handle.undeclare()
        self._handles.clear()

    def __enter__(self) -> Inbox:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _add_source(
        self, depth: int | None, decode: Callable[[Any], Event | None], low_priority: bool = False
    ) -> _Source:
        source = _Source(depth, decode, low_priority)
        self._sources.append(source)
        return source

    def _pusher(self, source: _Source) -> Callable[[Any], None]:
        def push(item: Any) -> None:
            stay_attached()
            self._push(source, item)

        return push

    def _push(self, source: _Source, item: Any) -> None:
        if source.push(item):
            self._tokens.put(source)
        self._wake_reader()

    def _wake_reader(self) -> None:
        if (wake := self._wake) is not None:
            try:
                wake()
            except RuntimeError:  # the reader's event loop is closed: nobody is left to wake
                self._wake = None
