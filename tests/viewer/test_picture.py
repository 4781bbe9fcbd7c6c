"""Which messages are drawn: routing follows from the contract's names."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.schemas import topics
from rackhand.schemas.topics import TOPICS, Qos, Topic
from rackhand.services.viewer.picture import DRAWN, NEWEST, NOT_DRAWN, route


@pytest.mark.parametrize("topic", TOPICS, ids=lambda topic: topic.name)
def test_every_topic_is_drawn_or_said_why_not(topic: Topic[Any]) -> None:
    if topic in NOT_DRAWN:
        assert NOT_DRAWN[topic]
        return
    assert topic in DRAWN
    view, method = route(topic)
    assert callable(getattr(view, method, None)), f"{view.__name__} has no method {method!r} for {topic.name}"


def test_of_streams_only_the_newest_is_drawn_and_poses_are_known_before_their_scans() -> None:
    streams = {topic for topic in DRAWN if topic.qos in (Qos.STREAM, Qos.COMMAND)}
    assert set(NEWEST) == streams
    assert next(iter(NEWEST)) is topics.POSE
