"""The table of topics: what services derive from its columns."""

from __future__ import annotations

import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.schemas.topics import QUERIES, TOPICS, Qos, Topic, published_by, read_by, served_by, websocket_topics
from rackhand.schemas.websocket import WsTopic


class ToyReading(Message):
    value: float


class ToyFrame(WsTopic):
    """a toy value"""

    TOPIC = "/toy"

    value: float


TOY = Topic(
    "chassis/toy", "rackhand/{robot}/chassis/toy", "chassis", ToyReading, "driver", ("planner", "gateway"), 10,
    Qos.STREAM, "a toy", (ToyFrame,),
)  # fmt: skip


def test_subscriptions_and_publications_are_derived_from_the_row(monkeypatch: pytest.MonkeyPatch) -> None:
    assert TOY not in published_by("driver")
    monkeypatch.setattr(topics, "TOPICS", (*TOPICS, TOY))
    assert TOY in published_by("driver") and TOY in published_by("sim", "driver", "localiser", owner="chassis")
    assert TOY in read_by("planner") and TOY in read_by("gateway", owner="chassis")
    assert TOY not in published_by("planner") and TOY not in read_by("controller")
    assert TOY not in read_by("gateway", owner="arm")
    assert ToyFrame in websocket_topics()


def test_each_topic_is_listed_once_for_the_roles_of_one_process() -> None:
    both = published_by("sim", "driver", "localiser")
    assert len(both) == len(set(both))
    assert set(both) == {topic for topic in TOPICS if topic.publisher in ("sim", "driver", "localiser")}


def test_period_is_that_of_the_rate() -> None:
    assert (topics.SCAN.period_ns, topics.ARM_STATE.period_ns, topics.COMMAND.period_ns) == (
        80_000_000,
        2_000_000,
        40_000_000,
    )
    assert topics.MAP.period_ns == 0


def test_keys_hold_a_name_where_the_owner_is_no_world() -> None:
    for row in (*TOPICS, *QUERIES):
        assert ("{robot}" in row.key) == (row.owner != "world")


def test_only_an_owner_of_a_kind_publishes_and_is_commanded() -> None:
    """Planners are for chassis, controllers for arms: a row that mixes them up would be subscribed to in vain."""
    wrong = {"chassis": "controller", "arm": "planner"}
    for row in TOPICS:
        assert wrong.get(row.owner) not in (row.publisher, *row.readers), row.name
    assert {query.owner for query in served_by("planner")} == {"chassis"}
    assert {query.owner for query in served_by("controller")} == {"arm"}


def test_a_latched_topic_is_no_measurement_of_a_driver_at_a_rate() -> None:
    for row in TOPICS:
        assert row.publisher != "driver" or (row.rate == 0) == (row.qos is Qos.LATCHED), row.name


def test_websocket_names_are_unique_and_each_is_described() -> None:
    views = websocket_topics()
    names = [view.TOPIC for view in views] + [view.LEGACY for view in views if view.LEGACY]
    assert len(names) == len(set(names)) and all(name.startswith("/") for name in names)
    assert all(view.__doc__ and view.RATE > 0 for view in views)
