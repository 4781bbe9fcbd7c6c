"""The robots that one gateway serves: each with its own state and its own WebSocket clients."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rackhand.bus import Inbox
from rackhand.schemas.base import Message
from rackhand.schemas.lift import LiftState
from rackhand.schemas.topics import Qos, Topic, read_by
from rackhand.services.gateway.presence import Services
from rackhand.services.gateway.state import RobotState
from rackhand.services.gateway.ws.broadcast import Hub

STREAM_DEPTH = 8  # unread samples of a stream worth keeping: clients get the newest


class Fleet:
    """State and clients of every chassis, by name. The first is the default robot; with none, there is one without a
    name, of which nothing is known.
    """

    def __init__(self, robots: Sequence[str], interval: Callable[[str], float], services: Services) -> None:
        self.names = tuple(dict.fromkeys(robots))
        self.services = services
        self.hubs = {name: Hub(RobotState(name), interval) for name in self.names or ("",)}

    @property
    def default(self) -> str:
        return self.names[0] if self.names else ""

    def subscribe(self, inbox: Inbox) -> None:
        """Everything the table of topics lets a gateway read of these robots, of lifts and of the world."""
        for topic in read_by("gateway", owner="chassis"):
            depth = STREAM_DEPTH if topic.qos is Qos.STREAM else None
            handler = partial(self.on_message, topic)
            for robot in self.names:
                inbox.on(topic, handler, robot, depth=depth)
        for topic in read_by("gateway", owner="world") if self.names else ():
            inbox.on(topic, partial(self.on_world_message, topic), depth=1)
        for topic in read_by("gateway", owner="lift") if self.names else ():
            inbox.on(topic, partial(self.on_message, topic), depth=STREAM_DEPTH if topic.qos is Qos.STREAM else None)

    def on_message(self, topic: Topic[Any], robot: str, message: Message) -> None:
        """``robot``: whose message it is, a chassis or a lift."""
        if topic.owner == "lift":
            self._on_lift_message(topic, robot, message)
        elif (hub := self.hubs.get(robot)) is not None:
            hub.on_message(topic, message)

    def on_world_message(self, topic: Topic[Any], _world: str, message: Message) -> None:
        for hub in self.hubs.values():
            hub.on_message(topic, message)

    def _on_lift_message(self, topic: Topic[Any], lift: str, message: Message) -> None:
        """Lifts are there for every chassis of the cell."""
        for hub in self.hubs.values():
            if isinstance(message, LiftState):
                hub.state.facts.lifts[lift] = message
            hub.on_message(topic, message)

    def close(self) -> None:
        for hub in self.hubs.values():
            hub.close()
