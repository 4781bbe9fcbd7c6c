"""Received messages, and counts of those that could not be parsed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import zenoh

from rackhand.bus.log import get_logger
from rackhand.schemas.codec import Codec, MalformedMessage
from rackhand.schemas.topics import Topic

log = get_logger(__name__)


@dataclass(frozen=True)
class Sample:
    """A received message: its topic, and the robot (or ``world``) whose topic it is."""

    topic: Topic[Any]
    robot: str
    message: Any


class Malformed(Counter[str]):
    """How many could not be parsed, by the name of their topic or query. The first of each is logged."""

    def count(self, name: str, error: MalformedMessage) -> None:
        self[name] += 1
        if self[name] == 1:
            log.warning(
                "malformed message dropped; further ones are counted but not logged", topic=name, error=str(error)
            )


def parse(topic: Topic[Any], codec: Codec[Any], raw: zenoh.Sample, malformed: Malformed) -> Sample | None:
    """The message; None, counted, if the payload is not one of the topic."""
    try:
        message = codec.loads(raw.payload.to_bytes(), str(raw.encoding))
    except MalformedMessage as error:
        malformed.count(topic.name, error)
        return None
    return Sample(topic, robot_of(raw), message)


def robot_of(raw: zenoh.Sample) -> str:
    return str(raw.key_expr).split("/", 2)[1]
