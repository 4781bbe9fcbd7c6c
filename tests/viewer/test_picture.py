"""Which messages are drawn: the topics that the table has the viewer read, each by one view."""

from __future__ import annotations

import pytest

from rackhand.schemas import topics
from rackhand.schemas.topics import Qos, read_by
from rackhand.services.viewer.picture import ROUTES, Picture, drawn_topics, newest_topics
from tests.gateway import messages


def test_every_topic_that_the_viewer_reads_is_drawn_and_no_other() -> None:
    assert {topic.name for topic in drawn_topics()} == set(ROUTES)


def test_a_topic_that_nothing_draws_is_an_error_at_the_start(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(ROUTES, topics.JACK.name)
    with pytest.raises(LookupError, match="no view draws chassis/jack"):
        drawn_topics()


def test_of_streams_only_the_newest_is_drawn_and_poses_are_known_before_their_scans() -> None:
    streams = {topic for topic in read_by("viewer") if topic.qos in (Qos.STREAM, Qos.COMMAND)}
    assert set(newest_topics()) == streams
    assert next(iter(newest_topics())) is topics.POSE
    assert newest_topics()[topics.POSE] > 1


def test_each_robot_has_a_view_of_its_own() -> None:
    picture = Picture()
    for robot in ("amr1", "amr2"):
        picture.on_message(topics.POSE, robot, messages.pose())
    assert picture.cast.chassis == ("amr1", "amr2")
