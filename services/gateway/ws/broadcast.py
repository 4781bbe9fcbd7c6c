"""One writer, many readers: every frame is made once, and no reader waits for another."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

from rackhand.bus.log import get_logger
from rackhand.schemas import topics
from rackhand.schemas import websocket as ws
from rackhand.schemas.base import Message
from rackhand.schemas.topics import Topic
from rackhand.services.gateway.state import Change, RobotState

log = get_logger(__name__)

MAX_EVENTS = 64
MAX_REPLIES = 64
MAX_UNREAD = 1024  # answers that a client which does not wait for them leaves unread
MAX_UNREAD_CHARACTERS = 8 * 1024 * 1024
MAX_TOPICS = 1000
REPEAT_AFTER = 12.0  # seconds of wall time without a change, as measured on a real Longjack


def frame(topic: str, payload: ws.Frame) -> str:
    """The text of a frame. Raises ``ValueError`` or ``TypeError`` for what JSON cannot carry."""
    fields = payload.model_dump(exclude_unset=True)
    return json.dumps({"topic": topic, **fields}, separators=(",", ":"), allow_nan=False)


class Outbox:
    """What one client is still to be sent, bounded: replies, then events in order, then the newest of each stream."""

    def __init__(self) -> None:
        self._replies: deque[str] = deque()
        self._events: deque[str] = deque(maxlen=MAX_EVENTS)
        self._newest: dict[str, str] = {}
        self._filled = asyncio.Event()
        self._room = asyncio.Event()
        self.dropped = 0
        self._unread = 0

    def stream(self, topic: str, text: str) -> None:
        """Takes the place of an older, unsent frame of the same topic."""
        self.dropped += topic in self._newest
        self._newest[topic] = text
        self._filled.set()

    def event(self, topic: str, text: str) -> None:
        """Sent in order; a client that is too slow for even these loses the oldest."""
        self._newest.pop(topic, None)  # an older sample must not follow the event
        self.dropped += len(self._events) == MAX_EVENTS
        self._events.append(text)
        self._filled.set()

    async def reply(self, text: str) -> None:
        """An answer to this client. One that asks without reading the answers waits here, and nobody else does."""
        while len(self._replies) >= MAX_REPLIES:
            self._room.clear()
            await self._room.wait()
        self._unread += len(text)
        self._replies.append(text)
        self._filled.set()

    def offer(self, text: str) -> bool:
        """An answer to this client, without waiting. False, and not taken, where too many are unread."""
        if len(self._replies) >= MAX_UNREAD or (self._replies and self._unread + len(text) > MAX_UNREAD_CHARACTERS):
            return False
        self._unread += len(text)
        self._replies.append(text)
        self._filled.set()
        return True

    async def next(self) -> str:
        """The next frame to send. One reader."""
        while True:
            if self._replies:
                self._room.set()
                text = self._replies.popleft()
                self._unread -= len(text)
                return text
            if self._events:
                return self._events.popleft()
            if self._newest:
                return self._newest.pop(next(iter(self._newest)))
            self._filled.clear()
            await self._filled.wait()


class Client:
    """One WebSocket connection: the topics it enabled, newest first, by the names it calls them."""

    def __init__(self, number: int, legacy: bool = False) -> None:
        self.number = number
        self.outbox = Outbox()
        self._canonical = {view.LEGACY: view.TOPIC for view in topics.websocket_topics() if legacy and view.LEGACY}
        self._names: dict[str, None] = {}
        self._by_topic: dict[str, list[str]] = {}

    @property
    def enabled(self) -> list[str]:
        return list(reversed(self._names))

    @property
    def identity(self) -> ws.Connection:
        return ws.Connection(id=self.number, username=f"client-{self.number}", email="")

    def change(self, enable: Iterable[str], disable: Iterable[str] = ()) -> list[str]:
        """Enable and disable topics. Returns those that were not enabled before.

        Raises ``ValueError``, and changes nothing, where that would enable more than ``MAX_TOPICS``.
        """
        dropped = set(disable)
        kept = {name: None for name in self._names if name not in dropped}
        fresh = [name for name in dict.fromkeys(enable) if name not in kept]
        if len(kept) + len(fresh) > MAX_TOPICS:
            raise ValueError(f"{len(kept) + len(fresh)} topics, want at most {MAX_TOPICS}")
        self._names = kept | dict.fromkeys(fresh)
        self._by_topic = {}
        for name in self._names:
            self._by_topic.setdefault(self.topic_of(name), []).append(name)
        return fresh

    def topic_of(self, name: str) -> str:
        return self._canonical.get(name, name)

    def names_of(self, topic: str) -> Iterable[str]:
        """What this client calls a topic, where it has enabled it."""
        return self._by_topic.get(topic, ())


class Hub:
    """Takes one robot's messages in and sends what they changed to clients that enabled it, no faster than each
    topic's rate.

    Lives in one event loop. ``interval`` gives the least seconds between two frames of a topic; ``repeat_after``, after
    how many the state topics that a real robot repeats are sent again.
    """

    def __init__(self, state: RobotState, interval: Callable[[str], float], repeat_after: float = REPEAT_AFTER) -> None:
        self.state = state
        self.clients: dict[int, Client] = {}
        self._interval = interval
        self._repeat_after = repeat_after
        self._numbers = itertools.count(1)
        self._last_sent: dict[str, float] = {}
        self._due: dict[str, asyncio.TimerHandle] = {}
        self._repeats: dict[str, asyncio.TimerHandle] = {}
        self._planning_changed = asyncio.Event()
        self._not_latched = {view.TOPIC for view in topics.websocket_topics() if not view.LATCHED}
        self._repeated = {view.TOPIC for view in topics.websocket_topics() if view.REPEATED}

    def join(self, legacy: bool = False) -> Client:
        client = Client(next(self._numbers), legacy)
        self.clients[client.number] = client
        everyone = ws.Connections(connections=[one.identity for one in self.clients.values()])
        client.outbox.event("/ws_connections", frame("/ws_connections", everyone))
        self._publish("/ws_connection_established", client.identity)
        return client

    def leave(self, client: Client) -> None:
        if self.clients.pop(client.number, None) is not None:
            self._publish("/ws_connection_disconnected", client.identity)

    def on_message(self, topic: Topic[Any], message: Message) -> None:
        for change in self.state.on_message(topic, message):
            self._changed(change)
        if topic is topics.PLANNING_STATE:
            self._planning_changed.set()

    async def wait_for_move(self, move_id: int, seconds: float) -> None:
        """Until the latched ``/planning_state`` is that of this move or a later one; at most so long."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not self.state.shows_move(move_id):
                    self._planning_changed.clear()
                    await self._planning_changed.wait()

    def send_present(self, client: Client, name: str) -> None:
        """The latched value of a topic the client has just enabled, if there is one."""
        if client.topic_of(name) in self._not_latched:
            return
        text = self._frame(client.topic_of(name), name)
        if text is not None:
            client.outbox.stream(name, text)

    def close(self) -> None:
        for timers in (self._due, self._repeats):
            for timer in timers.values():
                timer.cancel()
            timers.clear()

    def _changed(self, change: Change) -> None:
        topic = change.topic
        if change.urgent:
            self._cancel(topic)
            self._send(topic, urgent=True)
        elif topic not in self._due:
            loop = asyncio.get_running_loop()
            wait = self._last_sent.get(topic, 0.0) + self._interval(topic) - loop.time()
            if wait <= 0:
                self._send(topic)
            else:
                self._due[topic] = loop.call_later(wait, self._flush, topic)

    def _flush(self, topic: str) -> None:
        self._due.pop(topic, None)
        self._send(topic)

    def _due_again(self, topic: str) -> None:
        if (timer := self._repeats.pop(topic, None)) is not None:
            timer.cancel()
        self._repeats[topic] = asyncio.get_running_loop().call_later(self._repeat_after, self._send, topic)

    def _cancel(self, topic: str) -> None:
        timer = self._due.pop(topic, None)
        if timer is not None:
            timer.cancel()

    def _send(self, topic: str, urgent: bool = False) -> None:
        self._last_sent[topic] = asyncio.get_running_loop().time()
        readers = [(client, name) for client in self.clients.values() for name in client.names_of(topic)]
        texts = {name: self._frame(topic, name) for name in {name for _, name in readers}}
        if topic in self._repeated:
            self._due_again(topic)
        for client, name in readers:
            if (text := texts[name]) is None:
                continue
            if urgent:
                client.outbox.event(name, text)
            else:
                client.outbox.stream(name, text)

    def _frame(self, topic: str, name: str) -> str | None:
        """The topic's present value under that name. What JSON cannot carry (of a foreign publisher) is not sent."""
        try:
            payload = self.state.payload(topic)
            return None if payload is None else frame(name, payload)
        except (ValueError, TypeError, RecursionError) as error:
            log.warning(
                "value not encodable as JSON; frame not sent", topic=topic, robot=self.state.robot, error=str(error)
            )
            return None

    def _publish(self, topic: str, payload: ws.Frame) -> None:
        text = frame(topic, payload)
        for client in self.clients.values():
            client.outbox.event(topic, text)
