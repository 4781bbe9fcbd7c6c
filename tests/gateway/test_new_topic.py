"""A topic is one row: with it in the table, the gateway subscribes to it, and serves its frame."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any, cast

import pytest

from rackhand.bus import Inbox
from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.schemas.topics import TOPICS, Qos, Topic
from rackhand.schemas.websocket import WsTopic
from rackhand.services.gateway.fleet import Fleet
from rackhand.services.gateway.presence import Services
from rackhand.services.gateway.settings import Settings
from rackhand.services.gateway.ws import payloads
from rackhand.services.gateway.ws.facts import Facts
from rackhand.services.launch.reference import topic_table, websocket_table
from tests.gateway import messages
from tests.gateway.harness import new_app


class ToyReading(Message):
    value: float


class ToyFrame(WsTopic):
    """a toy value, doubled"""

    TOPIC = "/toy"
    RATE = 20.0

    twice: float


ROW = Topic(
    "chassis/toy", "rackhand/{robot}/chassis/toy", "chassis", ToyReading, "driver", ("gateway",), 10, Qos.STREAM,
    "a toy", (ToyFrame,),
)  # fmt: skip


def make_toy(facts: Facts) -> ToyFrame | None:
    reading = facts.newest(ROW)
    return None if reading is None else ToyFrame(twice=2 * reading.value)


class FakeInbox:
    """Keeps handlers by topic and robot."""

    def __init__(self) -> None:
        self.handlers: dict[tuple[str, str], Callable[[str, Any], None]] = {}

    def on(self, topic: Topic[Any], handler: Callable[[str, Any], None], robot: str = "*", **_depth: Any) -> None:
        self.handlers[topic.name, robot] = handler


@pytest.fixture
def one_more_row(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(topics, "TOPICS", (*TOPICS, ROW))
    monkeypatch.setattr(payloads, "PAYLOADS", payloads.PAYLOADS.copy())


def test_lifts_are_shown_to_the_clients_of_every_chassis() -> None:
    async def test() -> None:
        fleet, inbox = Fleet(("amr1", "amr2"), lambda _: 0.0, Services()), FakeInbox()
        fleet.subscribe(cast(Inbox, inbox))
        for name in ("lift_2", "lift_1"):
            inbox.handlers["lift/state", "*"](name, messages.lift(holder=name))
        for hub in fleet.hubs.values():
            shown = hub.state.payload("/lift_states")
            assert shown is not None
            assert [(row["name"], row["holder"]) for row in shown.model_dump()["lifts"]] == [
                ("lift_1", "lift_1"),
                ("lift_2", "lift_2"),
            ]
        fleet.close()

    asyncio.run(asyncio.wait_for(test(), 20))


def test_without_a_payload_function_the_gateway_does_not_start(one_more_row: None) -> None:
    with pytest.raises(LookupError, match="/toy"):
        new_app()


@pytest.mark.usefixtures("one_more_row")
def test_a_row_is_subscribed_served_paced_and_documented(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(payloads.PAYLOADS, "/toy", make_toy)
    monkeypatch.setattr("rackhand.services.gateway.state.PAYLOADS", payloads.PAYLOADS)

    async def test() -> None:
        fleet, inbox = Fleet(("amr1", "amr2"), lambda _: 0.0, Services()), FakeInbox()
        fleet.subscribe(cast(Inbox, inbox))
        client, other = (fleet.hubs[name].join() for name in fleet.names)
        for one in (client, other):
            one.change(["/toy"])
        inbox.handlers["chassis/toy", "amr2"]("amr2", ToyReading(value=1.5))
        frames = [json.loads(await other.outbox.next()) for _ in range(3)]
        assert frames[-1] == {"topic": "/toy", "twice": 3.0}
        assert "/toy" not in client.outbox._newest
        fleet.close()

    asyncio.run(asyncio.wait_for(test(), 20))
    assert Settings().interval("/toy") == 1 / 20
    assert any("chassis/toy" in row[0] and "/toy" in row[6] for row in topic_table()[1])
    assert ("`/toy`", "a toy value, doubled", "20 Hz", "the same") in websocket_table()[1]


def test_the_gateway_subscribes_to_what_the_table_says_and_nothing_else() -> None:
    fleet, inbox = Fleet(("amr1",), lambda _: 0.0, Services()), FakeInbox()
    fleet.subscribe(cast(Inbox, inbox))
    owners = ("chassis", "lift", "world")
    read = {topic.name for topic in TOPICS if "gateway" in topic.readers and topic.owner in owners}
    assert {name for name, _ in inbox.handlers} == read
    nobody = FakeInbox()
    Fleet((), lambda _: 0.0, Services()).subscribe(cast(Inbox, nobody))
    assert not nobody.handlers
