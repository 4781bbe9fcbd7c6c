"""What the gateway knows: of its robot, and of who is there. Events in, changes of WebSocket topics out."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from rackhand.bus import Event, Presence, Sample
from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Message
from rackhand.schemas.chassis import LocalisedPose, Odometry, Scan
from rackhand.schemas.service import ServiceId
from rackhand.services.gateway.ws.topics import CHANGED_BY, PAYLOADS, Facts, Payload

ACCELERATION_SPAN_NS = NANOSECONDS // 10

# The bus topics to subscribe to, with how many unread samples are worth keeping: of streams only the newest count.
SUBSCRIPTIONS: dict[topics.Topic[Any], int | None] = {
    topics.CLOCK: 1,
    topics.ODOMETRY: 8,
    topics.SCAN: 2,
    topics.POSE: 8,
    topics.BATTERY: 2,
    topics.JACK: 8,
    topics.CHASSIS_MODEL: None,
    topics.CHASSIS_STATUS: None,
    topics.PLANNING_STATE: None,
    topics.PATH: None,
    topics.MAP: None,
}
_FIELDS = {
    topics.CLOCK.name: "clock",
    topics.BATTERY.name: "battery",
    topics.JACK.name: "jack",
    topics.CHASSIS_MODEL.name: "model",
    topics.CHASSIS_STATUS.name: "status",
    topics.PLANNING_STATE.name: "planning",
    topics.PATH.name: "path",
    topics.MAP.name: "map",
}
# A message that differs from the last one only in these is one more sample of a stream; any other difference is an
# event that every client must see.
_STREAMED = {
    topics.PLANNING_STATE.name: {"stamp", "remaining_distance"},
    topics.CHASSIS_STATUS.name: {"stamp"},
    topics.JACK.name: {"stamp", "progress", "weight"},
}


@dataclass(frozen=True)
class Change:
    """A WebSocket topic has a new value. An ``urgent`` one is sent at once, to everyone, and never replaced."""

    topic: str
    urgent: bool = False


@dataclass
class ServiceState:
    """One service: whether it is there, since when (unix seconds), how often it came back."""

    alive: bool
    since: float
    restarts: int = 0


class State:
    """Everything heard. ``now`` is unix seconds, and only tells when services came and went."""

    def __init__(self, robot: str, expected: Iterable[ServiceId] = (), now: float = 0.0) -> None:
        self.robot = robot
        self.started = now
        self.facts = Facts()
        self.expected = tuple(expected)
        self.services: dict[ServiceId, ServiceState] = {}
        self._speeds: deque[tuple[int, float]] = deque()
        self._poses: deque[LocalisedPose] = deque(maxlen=8)
        self._lost = False

    def payload(self, topic: str) -> Payload | None:
        """The present value of a WebSocket topic; None where it is unknown or has none yet."""
        make = PAYLOADS.get(topic)
        return make(self.facts) if make is not None else None

    def on_message(self, event: Event, now: float) -> list[Change]:
        """Take an event in. Returns what it changed."""
        match event:
            case Sample(topic=topic, message=message):
                return self._sample(topic.name, message)
            case Presence(service=service, alive=alive):
                self._presence(service, alive, now)
        return []

    def tells_of_move(self, move_id: int) -> bool:
        return self.facts.planning is not None and self.facts.planning.action_id >= move_id

    @property
    def all_up(self) -> bool:
        return all(self.is_alive(service) for service in self.expected)

    def is_alive(self, service: ServiceId) -> bool:
        known = self.services.get(service)
        return known is not None and known.alive

    def _presence(self, service: ServiceId, alive: bool, now: float) -> None:
        known = self.services.get(service)
        if known is None:
            self.services[service] = ServiceState(alive, now)
        elif known.alive != alive:
            known.alive, known.since = alive, now
            known.restarts += alive

    def _sample(self, name: str, message: Message) -> list[Change]:
        match message:
            case Odometry():
                return [Change("/motion_metrics"), *self._odometry(message)]
            case Scan():
                self.facts.scan, self.facts.scan_pose = message, None
                return self._match_scan()
            case LocalisedPose():
                self.facts.pose, self._lost = message, False
                self._poses.append(message)
                return [*(Change(topic) for topic in CHANGED_BY[name]), *self._match_scan()]
        field = _FIELDS.get(name)
        if field is None:
            return []
        last = getattr(self.facts, field)
        setattr(self.facts, field, message)
        urgent = _is_event(name, last, message)
        return [Change(topic, urgent) for topic in CHANGED_BY.get(name, ())]

    def _odometry(self, message: Odometry) -> list[Change]:
        self.facts.odometry = message
        speeds = self._speeds
        if speeds and message.stamp <= speeds[-1][0]:  # time began anew
            speeds.clear()
        speeds.append((message.stamp, message.twist.linear))
        while len(speeds) > 2 and speeds[-1][0] - speeds[1][0] >= ACCELERATION_SPAN_NS:
            speeds.popleft()
        (begin, before), (end, after) = speeds[0], speeds[-1]
        self.facts.acceleration = (after - before) / ((end - begin) / NANOSECONDS) if end > begin else 0.0
        lost = self.facts.pose is not None and self.facts.quality != self.facts.pose.quality
        if lost == self._lost:
            return []
        self._lost = lost
        return [Change("/slam/state")]

    def _match_scan(self) -> list[Change]:
        """Pair the newest scan with the pose of its instant: the two arrive in either order."""
        scan = self.facts.scan
        if scan is None or self.facts.scan_pose is not None:
            return []
        pose = next((known for known in self._poses if known.stamp == scan.stamp), None)
        if pose is None:
            return []
        self.facts.scan_pose = pose.pose
        return [Change("/scan_matched_points2")]


def _is_event(name: str, last: Message | None, message: Message) -> bool:
    streamed = _STREAMED.get(name)
    if streamed is None:
        return False
    return last is None or last.model_dump(exclude=streamed) != message.model_dump(exclude=streamed)
