"""Typed handlers of an inbox's events: the table that brings each event to the function that was registered for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from rackhand.bus.samples import Sample
from rackhand.schemas.base import Message
from rackhand.schemas.refusal import RefusalCode
from rackhand.schemas.service import ServiceId
from rackhand.schemas.topics import Query, Topic

if TYPE_CHECKING:
    from rackhand.bus.requests import Request

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)
T = TypeVar("T")


@dataclass(frozen=True)
class Presence:
    """A service's liveliness token appeared (``alive``) or disappeared."""

    service: ServiceId
    alive: bool


@dataclass(frozen=True)
class Posted:
    """Something another thread of this process has finished, for the reader of the inbox."""

    handler: Callable[[Any], None]
    item: Any


class Handlers:
    """Which function takes which event. One handler a topic and a query; the types of both ends are checked statically.

    Events without a handler are ignored: a service may subscribe to a topic and read it from the inbox itself.
    """

    def __init__(self) -> None:
        self._topics: dict[str, Callable[[str, Any], None]] = {}
        self._queries: dict[str, Callable[[Any], None]] = {}
        self._presence: Callable[[ServiceId, bool], None] | None = None

    def on(self, topic: Topic[M], handler: Callable[[str, M], None]) -> None:
        """Call ``handler(robot, message)`` for each message. Raises ``ValueError`` for a second handler of a topic."""
        if self._topics.setdefault(topic.key, handler) != handler:
            raise ValueError(f"topic {topic.name} already has a handler")

    def on_request(self, query: Query[Q, R], handler: Callable[[Request[Q, R]], None]) -> None:
        """Call ``handler(request)`` for each request; it replies or refuses, now or later."""
        if self._queries.setdefault(query.key, handler) != handler:
            raise ValueError(f"query {query.name} already has a handler")

    def on_presence(self, handler: Callable[[ServiceId, bool], None]) -> None:
        """Call ``handler(service, alive)`` when a liveliness token appears or disappears."""
        self._presence = handler

    def dispatch(self, event: Sample | Request[Any, Any] | Presence | Posted) -> None:
        """Bring one event to its handler. What the handler raises passes."""
        match event:
            case Sample():
                if (take := self._topics.get(event.topic.key)) is not None:
                    take(event.robot, event.message)
            case Presence():
                if self._presence is not None:
                    self._presence(event.service, event.alive)
            case Posted():
                event.handler(event.item)
            case _:
                if (serve := self._queries.get(event.query.key)) is not None:
                    serve(event)
                else:
                    event.refuse(RefusalCode.INTERNAL, f"{event.query.name} has no handler")
