"""Streams that are looked at now and then: the newest of each robot, between sessions."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import zenoh

from rackhand.bus import Bus, BusConfig, Inbox, Newest, Publisher, Sample
from rackhand.schemas import topics
from rackhand.schemas.moves import PlanningState
from rackhand.schemas.service import WORLD, ServiceId
from tests.gateway import messages

ROBOTS = ("amr1", "amr2")


def told(samples: Iterator[Sample]) -> list[tuple[str, int]]:
    return [(sample.robot, sample.message.stamp) for sample in samples]


class Pair:
    """Who publishes, and who looks. What was published before ``arrived`` has come: a link keeps the order."""

    def __init__(self, speaker: Bus, reader: Bus) -> None:
        self.reader = reader
        self.inbox: Inbox = reader.inbox().subscribe(topics.PLANNING_STATE)
        self.newest: Newest = reader.newest()
        self.odometry = {robot: speaker.publisher(topics.ODOMETRY, robot) for robot in ROBOTS}
        self._mark: Publisher[PlanningState] = speaker.publisher(topics.PLANNING_STATE, "amr1")
        self._marks = 0

    def meet(self) -> None:
        """Until the two have found each other: a stream has no memory."""
        missing = set(ROBOTS)
        while missing:
            for robot in ROBOTS:
                self.odometry[robot].put(messages.odometry(0))
            missing -= {robot for robot, _ in told(self.newest.take())}
        self.arrived()
        list(self.newest.take())

    def arrived(self) -> None:
        self._marks += 1
        self._mark.put(PlanningState(stamp=0, action_id=self._marks))
        while True:
            event = self.inbox.get(timeout=20)
            assert isinstance(event, Sample)
            if event.message.action_id == self._marks:
                return


@pytest.fixture
def pair(router: str) -> Iterator[Pair]:
    config = BusConfig(connect=router)
    with Bus(ServiceId("sim", WORLD), config) as speaker, Bus(ServiceId("viewer", "cell"), config) as reader:
        yield Pair(speaker, reader)


def test_the_newest_of_each_robot_is_given_and_given_once(pair: Pair) -> None:
    pair.newest.follow(topics.ODOMETRY)
    pair.meet()
    before = pair.reader.stats()
    for stamp in range(1, 11):
        for robot in ROBOTS:
            pair.odometry[robot].put(messages.odometry(stamp))
    pair.arrived()
    assert sorted(told(pair.newest.take())) == [("amr1", 10), ("amr2", 10)]
    assert not told(pair.newest.take())
    after = pair.reader.stats()
    assert after.received - before.received == 2 + 1  # the mark is in the inbox
    assert after.dropped - before.dropped == 18


def test_as_many_are_kept_as_were_asked_for_in_order(pair: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where the ring pushes out what is older. Few samples: of a flood a link may drop the last."""
    monkeypatch.setattr("rackhand.bus.newest.RING", 4)
    pair.newest.follow(topics.ODOMETRY, keep=3)
    pair.meet()
    for stamp in range(1, 11):
        pair.odometry["amr1"].put(messages.odometry(stamp))
    pair.arrived()
    assert told(pair.newest.take()) == [("amr1", 8), ("amr1", 9), ("amr1", 10)]


def test_what_is_no_message_is_counted_and_hides_no_other_robot(pair: Pair, router: str) -> None:
    pair.newest.follow(topics.ODOMETRY)
    pair.meet()
    with zenoh.open(BusConfig(connect=router).zenoh_config()) as stranger:
        while pair.newest.malformed.total() == 0:
            pair.odometry["amr2"].put(messages.odometry(7))
            stranger.put(topics.ODOMETRY.key_for("amr1"), b"\xc1")
            assert set(told(pair.newest.take())) <= {("amr2", 7)}
        pair.odometry["amr2"].put(messages.odometry(8))
        pair.arrived()
        assert ("amr2", 8) in told(pair.newest.take())
    assert pair.reader.stats().malformed >= 1
