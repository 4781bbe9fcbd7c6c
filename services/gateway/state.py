"""What the gateway knows of one robot. Messages in, changes of WebSocket topics out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from rackhand.schemas import topics
from rackhand.schemas import websocket as ws
from rackhand.schemas.base import Message
from rackhand.schemas.topics import Topic
from rackhand.schemas.websocket_racks import LoadFrame
from rackhand.schemas.websocket_sensors import MatchedLaser, Trajectory
from rackhand.services.gateway.ws import lift_payloads, rack_payloads, sensor_payloads  # noqa: F401 - they register
from rackhand.services.gateway.ws.facts import Facts
from rackhand.services.gateway.ws.payloads import PAYLOADS

# A message that differs from the last one only in these is one more sample of a stream; any other difference is an
# event that every client must see.
_STREAMED = {
    topics.LOAD.name: {"stamp"},
    topics.DETECTED_RACK.name: {"stamp", "pose", "width", "depth", "legs", "staging"},
    topics.PLANNING_STATE.name: {"stamp", "remaining_distance"},
    topics.CHASSIS_STATUS.name: {"stamp"},
    topics.JACK.name: {"stamp", "progress", "weight"},
}
_OF_MATCHED = (ws.MatchedPoints, MatchedLaser, Trajectory)  # they change with a scan whose pose is known


@dataclass(frozen=True)
class Change:
    """A WebSocket topic has a new value. An ``urgent`` one is sent at once, to everyone, and never replaced."""

    topic: str
    urgent: bool = False


class RobotState:
    """Everything received of one robot; ``robot`` is empty where the gateway serves no chassis."""

    def __init__(self, robot: str) -> None:
        self.robot = robot
        self.facts = Facts()
        self._quality = self.facts.quality

    def payload(self, topic: str) -> ws.WsTopic | None:
        """The present value of a WebSocket topic; None where it is unknown or has none yet."""
        make = PAYLOADS.get(topic)
        return make(self.facts) if make is not None else None

    def on_message(self, topic: Topic[Any], message: Message) -> list[Change]:
        """Take a message in. Returns the WebSocket topics that it changed."""
        last = self.facts.newest(topic)
        matched = self.facts.add(topic, message)
        urgent = _is_event(topic.name, last, message)
        return [Change(view.TOPIC, urgent) for view in self._changed(topic, matched)]

    def shows_move(self, move_id: int) -> bool:
        """Whether ``/planning_state`` is that of this move or a later one."""
        planning = self.facts.newest(topics.PLANNING_STATE)
        return planning is not None and planning.action_id >= move_id

    def _is_carrying(self) -> bool:
        load = self.facts.newest(topics.LOAD)
        return load is not None and load.state == "carrying"

    def _changed(self, topic: Topic[Any], matched: bool) -> Iterable[type[ws.WsTopic]]:
        before, self._quality = self._quality, self.facts.quality
        for view in topic.ws:
            if view in _OF_MATCHED and not matched:
                continue
            if view is LoadFrame and topic is topics.POSE and not self._is_carrying():
                continue
            yield view
        if topic is topics.ODOMETRY and self._quality != before:  # the pose has become too old
            yield ws.SlamState


def _is_event(name: str, last: Message | None, message: Message) -> bool:
    streamed = _STREAMED.get(name)
    if streamed is None:
        return False
    return last is None or last.model_dump(exclude=streamed) != message.model_dump(exclude=streamed)
