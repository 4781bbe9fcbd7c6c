"""The session: publishers, calls, presence."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeout
from types import FrameType, TracebackType
from typing import Any, Generic, TypeVar

import zenoh
import zenoh.ext

from rackhand.bus.config import BusConfig
from rackhand.bus.errors import CallTimeout, Refused, Unavailable
from rackhand.bus.inbox import Inbox
from rackhand.bus.newest import Newest
from rackhand.schemas.base import Message
from rackhand.schemas.codec import Codec, MalformedMessage, codec_for
from rackhand.schemas.refusal import Refusal, RefusalCode
from rackhand.schemas.service import WORLD, BusStats, ServiceId
from rackhand.schemas.topics import BUS_STATS, Qos, Query, Topic

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

AGAIN = 0.1  # s between two calls of what is not served yet
_REFUSAL = codec_for(Refusal)
# One priority for all that must keep its order; commands overtake data.
_PRIORITY = dict.fromkeys(Qos, zenoh.Priority.DATA) | {Qos.COMMAND: zenoh.Priority.DATA_HIGH}


# A late joiner's copy is distinguished from the live one by sequence numbers; timestamps would do too, but are off.
_NUMBERED = zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=None)


class Publisher(Generic[M]):
    """Publishes one topic of one robot."""

    def __init__(self, topic: Topic[M], publisher: Any) -> None:
        self._codec = codec_for(topic.model)
        self._publisher = publisher

    def put(self, message: M) -> None:
        """Publish. Never waits for a reader of a stream; raises ``MalformedMessage``."""
        payload = self._codec.dumps(message)
        with contextlib.suppress(zenoh.ZError):  # the session is closing
            self._publisher.put(payload)


class Reporter:
    """Publishes what ``report`` returns once a second of the machine's time, in a thread of its own."""

    def __init__(self, publisher: Publisher[M], report: Callable[[], M], period: float = 1.0) -> None:
        self._publisher, self._report, self._period = publisher, report, period
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bus-stats", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._closing.wait(self._period):
            self._publisher.put(self._report())

    def close(self) -> None:
        self._closing.set()
        self._thread.join()


class Bus:
    """One service's connection. Use as a context manager: a session left open would keep the process alive for ever."""

    def __init__(self, service: ServiceId, config: BusConfig | None = None) -> None:
        self.service = service
        self._config = config or BusConfig()
        self._readers: list[Inbox | Newest] = []
        self._handles: list[Any] = []
        self._parts: dict[ServiceId, Any] = {}  # tokens of those it plays for others
        self.stopping = False
        self._reporter: Reporter | None = None

    def __enter__(self) -> Bus:
        self._session = zenoh.open(self._config.zenoh_config())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()
        if self._reporter is not None:
            self._reporter.close()
        for reader in self._readers:
            reader.close()
        for handle in (*self._handles, *self._parts.values()):
            handle.undeclare()
        self._session.close()  # type: ignore[no-untyped-call]

    # -- publish, subscribe ------------------------------------------------------------------------------------------

    def publisher(self, topic: Topic[M], robot: str = WORLD) -> Publisher[M]:
        options: dict[str, Any] = {
            "encoding": codec_for(topic.model).encoding,
            "priority": _PRIORITY[topic.qos],
            "congestion_control": zenoh.CongestionControl.DROP
            if topic.qos is Qos.STREAM
            else zenoh.CongestionControl.BLOCK,
            "express": topic.qos in (Qos.STREAM, Qos.COMMAND),
        }
        key = topic.key_for(robot)
        if topic.qos is Qos.LATCHED:
            publisher: Any = zenoh.ext.declare_advanced_publisher(
                self._session,
                key,
                cache=zenoh.ext.CacheConfig(1),
                publisher_detection=True,
                sample_miss_detection=_NUMBERED,
                **options,
            )
        else:
            publisher = self._session.declare_publisher(key, **options)
        self._handles.append(publisher)
        return Publisher(topic, publisher)

    def inbox(self) -> Inbox:
        """A new queue of events; see ``Inbox``."""
        inbox = Inbox(self)
        self._readers.append(inbox)
        return inbox

    def newest(self) -> Newest:
        """A reader that polls; see ``Newest``."""
        newest = Newest(self)
        self._readers.append(newest)
        return newest

    # -- query -------------------------------------------------------------------------------------------------------

    def call_when_served(
        self, query: Query[Q, R], request: Q, robot: str = WORLD, timeout: float = 2.0, patience: float = 5.0
    ) -> R:
        """``call``, repeated for ``patience`` seconds of wall time while nothing serves the query.

        For a program that has just connected: it learns within a moment what is served, on a busy machine in seconds.
        """
        deadline = time.monotonic() + patience
        while True:
            try:
                return self.call(query, request, robot, timeout)
            except Unavailable:
                if time.monotonic() >= deadline:
                    raise
            time.sleep(AGAIN)

    def call(self, query: Query[Q, R], request: Q, robot: str = WORLD, timeout: float = 2.0) -> R:
        """Call and wait. Raises ``Refused``, ``CallTimeout``, or ``Unavailable`` (at once when nothing serves it)."""
        future, cancel = self._ask(query, request, robot, timeout)
        try:
            replies = future.result(timeout + 0.5)
        except FutureTimeout:
            cancel()
            raise CallTimeout(f"{query.name} of {robot} did not answer within {timeout} s") from None
        return self._answer(query, robot, timeout, replies)

    async def acall(self, query: Query[Q, R], request: Q, robot: str = WORLD, timeout: float = 2.0) -> R:
        """The asyncio twin of ``call``; cancelling the task cancels the query."""
        future, cancel = self._ask(query, request, robot, timeout)
        try:
            replies = await asyncio.wait_for(asyncio.wrap_future(future), timeout + 0.5)
        except (TimeoutError, asyncio.CancelledError) as error:
            await asyncio.get_running_loop().run_in_executor(None, cancel)
            if isinstance(error, TimeoutError):
                raise CallTimeout(f"{query.name} of {robot} did not answer within {timeout} s") from None
            raise
        return self._answer(query, robot, timeout, replies)

    def _ask(
        self, query: Query[Q, R], request: Q, robot: str, timeout: float
    ) -> tuple[Future[list[zenoh.Reply]], Callable[[], None]]:
        codec = codec_for(query.request)
        payload = codec.dumps(request)
        future: Future[list[zenoh.Reply]] = Future()
        replies: list[zenoh.Reply] = []
        token = zenoh.CancellationToken()

        def done() -> None:
            if future.set_running_or_notify_cancel():
                future.set_result(replies)

        self._session.get(
            query.key_for(robot),
            zenoh.handlers.Callback(replies.append, done, indirect=False),
            payload=payload,
            encoding=codec.encoding,
            timeout=timeout,
            consolidation=zenoh.ConsolidationMode.NONE,
            cancellation_token=token,
        )
        return future, token.cancel

    def _answer(self, query: Query[Q, R], robot: str, timeout: float, replies: list[zenoh.Reply]) -> R:
        codec: Codec[R] = codec_for(query.reply)
        for reply in replies:
            if reply.ok is not None:
                return codec.loads(reply.ok.payload.to_bytes(), str(reply.ok.encoding))
        if not replies:
            raise Unavailable(f"no service answers {query.name} of {robot}")
        error = replies[0].err
        if error is None or str(error.encoding) != _REFUSAL.encoding:  # Zenoh's own error: time is up
            raise CallTimeout(f"{query.name} of {robot} did not answer within {timeout} s")
        try:
            refusal = _REFUSAL.loads(error.payload.to_bytes())
        except MalformedMessage as malformed:
            raise Refused(RefusalCode.INTERNAL, str(malformed)) from None
        raise Refused(refusal.code, refusal.text)

    # -- presence ----------------------------------------------------------------------------------------------------

    def announce(self, *parts: ServiceId) -> None:
        """Declare liveliness tokens: this service is ready, and so are the ``parts`` it plays for others (a simulator
        is the driver of each robot). They disappear when the process ends, however it ends."""
        for part in parts:
            self.announce_part(part)
        self._handles.append(self._session.liveliness().declare_token(self.service.key))
        self._reporter = Reporter(self.publisher(BUS_STATS, self.service.robot), self.stats)

    def announce_part(self, part: ServiceId) -> None:
        """Declare the token of one of the parts, which has none; ``withdraw`` ends it."""
        self._parts[part] = self._session.liveliness().declare_token(part.key)

    def withdraw(self, part: ServiceId) -> None:
        """The part that was announced is gone, though this process is not."""
        self._parts.pop(part).undeclare()

    def stats(self) -> BusStats:
        """What all its readers have received so far."""
        return BusStats(
            service=self.service.service,
            received=sum(reader.received for reader in self._readers),
            dropped=sum(reader.dropped for reader in self._readers),
            malformed=sum(reader.malformed.total() for reader in self._readers),
        )

    def stop(self) -> None:
        """End the iteration of every inbox. May be called from a signal handler and from any thread."""
        self.stopping = True
        for reader in self._readers:
            reader.stop()

    def handle_signals(self) -> None:
        """Let SIGTERM and SIGINT end the inboxes' iteration, so that the process ends by returning."""

        def stop(_signum: int, _frame: FrameType | None) -> None:
            self.stop()

        signal.signal(signal.SIGTERM, stop)
        signal.signal(signal.SIGINT, stop)

    # -- for the readers ---------------------------------------------------------------------------------------------

    def declare_subscriber(self, key: str, qos: Qos, push: Callable[[zenoh.Sample], None]) -> Any:
        # Direct callbacks run in the order of arrival on the link, across topics; all they do is put into a queue.
        handler = zenoh.handlers.Callback(push, indirect=False)
        if qos is Qos.LATCHED:
            history = zenoh.ext.HistoryConfig(detect_late_publishers=True)
            return zenoh.ext.declare_advanced_subscriber(self._session, key, handler, history=history)
        return self._session.declare_subscriber(key, handler)

    def declare_ring(self, key: str, size: int) -> Any:
        """A subscriber that is polled with ``try_recv``: it keeps the newest ``size`` samples."""
        return self._session.declare_subscriber(key, zenoh.handlers.RingChannel(size))

    def declare_queryable(self, key: str, push: Callable[[zenoh.Query], None]) -> Any:
        return self._session.declare_queryable(key, zenoh.handlers.Callback(push, indirect=False), complete=True)

    def declare_liveliness_subscriber(self, key: str, push: Callable[[zenoh.Sample], None]) -> Any:
        handler = zenoh.handlers.Callback(push, indirect=False)
        return self._session.liveliness().declare_subscriber(key, handler, history=True)
