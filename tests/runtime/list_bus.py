"""A bus that is a list of events, for the shells of services: what they publish for what they receive."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from rackhand.bus import Handlers, Posted, Request, Unavailable
from rackhand.schemas.base import Message


class Asked(Request[Any, Any]):
    """A request that no session sent; it remembers its answer."""

    def __init__(self, query: Any, message: Message, robot: str = "amr1") -> None:
        self.query, self.robot, self.message = query, robot, message
        self.answer: Any = None

    def reply(self, message: Message) -> None:
        assert self.answer is None
        self.answer = message

    def refuse(self, code: str, text: str) -> None:
        self.answer = self.answer or (code, text)

    def __del__(self) -> None:
        pass


@dataclass
class ListBus:
    """Bus and inbox in one. ``batches`` of events: within one they wait together, between them the service has time.

    A number in a batch lets so many seconds of monotonic time pass; ``now`` is the monotonic clock.
    """

    batches: list[list[Any]] = field(default_factory=list)
    put: list[tuple[Any, Any]] = field(default_factory=list)
    calls: list[Any] = field(default_factory=list)
    unavailable: int = 0
    announced: bool = False
    now: float = 0.0
    handlers: Handlers = field(default_factory=Handlers)
    subscribed: list[Any] = field(default_factory=list)

    # -- the bus -----------------------------------------------------------------------------------------------------

    @property
    def stopping(self) -> bool:
        return not self.batches

    def publisher(self, topic: Any, _robot: str) -> Any:
        return type("Put", (), {"put": lambda _self, message: self.put.append((topic, message))})()

    def inbox(self) -> ListBus:
        self.handlers = Handlers()
        return self

    def announce(self) -> None:
        self.announced = True

    def call(self, query: Any, request: Any, **_: Any) -> None:
        self.calls.append((query, request.request))
        if self.unavailable:
            self.unavailable -= 1
            raise Unavailable("nobody serves world/control")

    def published(self, topic: Any) -> list[Any]:
        return [message for published, message in self.put if published is topic]

    # -- the inbox ---------------------------------------------------------------------------------------------------

    def on(self, topic: Any, handler: Any, *_: Any) -> None:
        self.subscribed.append(topic)
        self.handlers.on(topic, handler)

    def on_request(self, query: Any, handler: Any, *_: Any) -> None:
        self.subscribed.append(query)
        self.handlers.on_request(query, handler)

    def on_presence(self, handler: Any) -> None:
        self.handlers.on_presence(handler)

    def poster(self, handler: Callable[[Any], None]) -> Callable[[Any], None]:
        return lambda item: self.batches[0].insert(0, Posted(handler, item))

    def dispatch(self, event: Any) -> None:
        self.handlers.dispatch(event)

    def get(self, timeout: float | None) -> Any:
        """The next event of this batch; at its end None, and the next wait is for the next batch."""
        if timeout != 0 and self.batches and not self.batches[0]:
            self.batches.pop(0)
        if not self.batches or not self.batches[0]:
            return None
        if isinstance(self.batches[0][0], float):
            return self._let_pass(timeout)
        return self.batches[0].pop(0)

    def _let_pass(self, timeout: float | None) -> None:
        """Time passes while the service waits; it wakes after ``timeout`` of it."""
        left = self.batches[0][0]
        passed = left if timeout is None else min(timeout, left)
        self.now += passed
        if passed == left:
            self.batches[0].pop(0)
        elif timeout:
            self.batches[0][0] = left - passed
