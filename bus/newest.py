"""Reading streams by polling: the newest samples, for readers that do not need each one."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import zenoh

from rackhand.bus.samples import Malformed, Sample, parse, robot_of
from rackhand.schemas.codec import Codec, codec_for
from rackhand.schemas.topics import Topic

if TYPE_CHECKING:
    from rackhand.bus.session import Bus

RING = 64  # samples of a topic, of all robots, that are kept until the next ``take``


@dataclass(frozen=True)
class _Followed:
    topic: Topic[Any]
    codec: Codec[Any]
    keep: int
    subscriber: Any


class Newest:
    """The newest samples of each robot since the last ``take``.

    No Python code runs when a sample arrives, and only samples that ``take`` returns are decoded: it costs much less
    than an ``Inbox``, which wakes its reader for each. ``dropped`` counts samples that newer ones of the same robot
    replaced, but not those that Zenoh dropped from a full ring of ``RING``.
    """

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._followed: list[_Followed] = []
        self.received = 0
        self.dropped = 0
        self.malformed = Malformed()

    def follow(self, topic: Topic[Any], robot: str = "*", keep: int = 1) -> Newest:
        """Also return the newest ``keep`` samples of this topic."""
        subscriber = self._bus.declare_ring(topic.key_for(robot), RING)
        self._followed.append(_Followed(topic, codec_for(topic.model), keep, subscriber))
        return self

    def take(self) -> Iterator[Sample]:
        """Topics in the order of ``follow``; of each, the samples of a robot in order of arrival."""
        for followed in self._followed:
            for raw in self._drained(followed):
                sample = parse(followed.topic, followed.codec, raw, self.malformed)
                if sample is not None:
                    self.received += 1
                    yield sample

    def _drained(self, followed: _Followed) -> list[zenoh.Sample]:
        kept: dict[str, deque[zenoh.Sample]] = defaultdict(lambda: deque(maxlen=followed.keep))
        count = 0
        while (raw := followed.subscriber.try_recv()) is not None:
            kept[robot_of(raw)].append(raw)
            count += 1
        newest = [raw for samples in kept.values() for raw in samples]
        self.dropped += count - len(newest)
        return newest

    def stop(self) -> None:
        """No call here blocks: nothing has to be woken."""

    def close(self) -> None:
        for followed in self._followed:
            followed.subscriber.undeclare()
        self._followed.clear()
