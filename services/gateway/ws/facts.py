"""The newest message of each topic of one robot, and what follows from several of them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import Any, TypeVar, cast

from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Message, Pose2
from rackhand.schemas.chassis import Odometry, Scan
from rackhand.schemas.lift import LiftState
from rackhand.schemas.scan_points import ScanPairing
from rackhand.schemas.topics import Topic
from rackhand.services.gateway.mapping import Mappings
from rackhand.services.gateway.ws.files import Files

M = TypeVar("M", bound=Message)

LOST_QUALITY = 1
POSE_LIFE_NS = NANOSECONDS  # an older pose, by the stamps of odometry, is not the robot's present pose
ACCELERATION_SPAN_NS = NANOSECONDS // 10


class Facts:
    """What is known of one robot.

    ``acceleration`` in m/s², over the last tenth of a second. ``matched``: the newest scan with the pose at which it
    was taken. ``files``: what frames refer to by URL. ``lifts``: state of each lift of the cell by name. ``mappings``:
    maps drawn from the scans. ``travelled``: metres since the stamp ``travelled_since``.
    """

    def __init__(self, messages: Mapping[Topic[Any], Message] | None = None) -> None:
        self._newest: dict[str, Message] = {}
        self.acceleration = 0.0
        self.matched: tuple[Scan, Pose2] | None = None
        self.files = Files()
        self.mappings = Mappings()
        self.travelled, self.travelled_since = 0.0, 0
        self._last_odometry: Odometry | None = None
        self.lifts: dict[str, LiftState] = {}
        self._speeds: deque[tuple[int, float]] = deque()
        self._pairing = ScanPairing()
        for topic, message in (messages or {}).items():
            self.add(topic, message)

    def newest(self, topic: Topic[M]) -> M | None:
        """The newest message of a topic; None before the first."""
        return cast(M | None, self._newest.get(topic.name))

    def add(self, topic: Topic[Any], message: Any) -> bool:
        """Take a message in. True if it gave the newest scan its pose."""
        self._newest[topic.name] = message
        pair = None
        if topic is topics.ODOMETRY:
            self._accelerate(message)
            self._travel(message)
        elif topic is topics.POSE:
            pair = self._pairing.add_pose(message)
        elif topic is topics.SCAN:
            pair = self._pairing.add_scan(message)
        self.matched = pair or self.matched
        if pair is not None:
            self.mappings.take(*pair)
        return pair is not None

    def unix(self, stamp: int) -> float:
        """Unix seconds of a stamp. Without a simulator, stamps are unix nanoseconds themselves."""
        return self.unix_ns(stamp) / NANOSECONDS

    def unix_ns(self, stamp: int) -> int:
        clock = self.newest(topics.CLOCK)
        return stamp + (clock.unix_ns if clock else 0)

    @property
    def quality(self) -> int:
        """How well the pose is known, 0 … 10, as in ``LocalisedPose``."""
        pose, odometry = self.newest(topics.POSE), self.newest(topics.ODOMETRY)
        if pose is None:
            return 0
        if odometry is not None and odometry.stamp - pose.stamp > POSE_LIFE_NS:
            return LOST_QUALITY
        return pose.quality

    def _travel(self, odometry: Odometry) -> None:
        last, self._last_odometry = self._last_odometry, odometry
        if last is None or odometry.stamp <= last.stamp:  # the first one, or the clock was reset
            self.travelled_since = odometry.stamp
            return
        self.travelled += math.hypot(odometry.pose.x - last.pose.x, odometry.pose.y - last.pose.y)

    def _accelerate(self, odometry: Odometry) -> None:
        speeds = self._speeds
        if speeds and odometry.stamp <= speeds[-1][0]:  # the clock was reset
            speeds.clear()
        speeds.append((odometry.stamp, odometry.twist.linear))
        while len(speeds) > 2 and speeds[-1][0] - speeds[1][0] >= ACCELERATION_SPAN_NS:
            speeds.popleft()
        (begin, before), (end, after) = speeds[0], speeds[-1]
        self.acceleration = (after - before) / ((end - begin) / NANOSECONDS) if end > begin else 0.0
