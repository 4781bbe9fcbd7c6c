"""Outboxes and the hub, without sockets."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Coroutine
from typing import Any

from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.services.gateway.state import RobotState
from rackhand.services.gateway.ws.broadcast import MAX_EVENTS, MAX_REPLIES, Client, Hub, Outbox
from tests.gateway import messages


def run(test: Coroutine[Any, Any, None]) -> None:
    asyncio.run(asyncio.wait_for(test, 20))


def sent(client: Client) -> list[dict[str, Any]]:
    """All that waits to be sent, in order, but for what tells of connections."""

    async def drain() -> list[str]:
        box, texts = client.outbox, []
        while box._replies or box._events or box._newest:
            texts.append(await box.next())
        return texts

    task = drain()
    try:
        task.send(None)
    except StopIteration as end:
        frames = [json.loads(text) for text in end.value]
        return [frame for frame in frames if not frame["topic"].startswith("/ws_connection")]
    raise AssertionError("the outbox waits though it is not empty")


def hub(interval: float) -> tuple[Hub, Client]:
    made = Hub(RobotState("amr1"), lambda _topic: interval)
    return made, made.join()


def pose(x: float) -> tuple[topics.Topic[Any], Message]:
    return topics.POSE, messages.pose(x=x)


def planning(**changes: Any) -> tuple[topics.Topic[Any], Message]:
    return topics.PLANNING_STATE, messages.planning(**changes)


def test_replies_come_first_then_events_in_order_then_the_newest_of_each_stream() -> None:
    async def test() -> None:
        box = Outbox()
        box.stream("/a", "a1")
        box.event("/e", "e1")
        box.stream("/b", "b1")
        box.stream("/a", "a2")
        box.event("/e", "e2")
        await box.reply("r1")
        assert [await box.next() for _ in range(5)] == ["r1", "e1", "e2", "a2", "b1"]
        assert box.dropped == 1

    run(test())


def test_an_older_sample_never_follows_an_event_of_its_topic() -> None:
    async def test() -> None:
        box = Outbox()
        box.stream("/planning_state", "moving, 2 m left")
        box.event("/planning_state", "succeeded")
        assert await box.next() == "succeeded"
        assert not box._newest

    run(test())


def test_events_beyond_the_bound_push_out_the_oldest() -> None:
    async def test() -> None:
        box = Outbox()
        for number in range(MAX_EVENTS + 2):
            box.event("/e", str(number))
        assert box.dropped == 2
        assert await box.next() == "2"

    run(test())


def test_a_client_that_does_not_read_replies_waits_to_ask_more() -> None:
    async def test() -> None:
        box = Outbox()
        for _ in range(MAX_REPLIES):
            await box.reply("r")
        waiting = asyncio.create_task(box.reply("last"))
        await asyncio.sleep(0)
        assert not waiting.done()
        assert await box.next() == "r"
        await waiting

    run(test())


def test_a_stream_is_held_to_its_rate_and_its_last_value_is_sent() -> None:
    async def test() -> None:
        broadcaster, client = hub(interval=0.02)
        client.change(["/tracked_pose"])
        for x in range(10):
            broadcaster.on_message(*pose(x))
        assert [frame["pos"][0] for frame in sent(client)] == [0]
        assert json.loads(await client.outbox.next())["pos"][0] == 9
        broadcaster.close()

    run(test())


def test_events_are_never_held_back_nor_overtaken_by_an_older_sample() -> None:
    async def test() -> None:
        broadcaster, client = hub(interval=1000.0)
        client.change(["/planning_state"])
        broadcaster.on_message(*planning(remaining_distance=3.0))  # the first is an event
        broadcaster.on_message(*planning(remaining_distance=2.0))  # held back
        broadcaster.on_message(*planning(move_state="succeeded", remaining_distance=0.1))
        broadcaster.on_message(*planning(action_id=8, remaining_distance=5.0))
        assert [(frame["action_id"], frame["move_state"]) for frame in sent(client)] == [
            (7, "moving"),
            (7, "succeeded"),
            (8, "moving"),
        ]
        assert not broadcaster._due
        broadcaster.close()

    run(test())


def test_who_waits_for_a_move_waits_until_it_is_reported_of_and_not_for_ever() -> None:
    async def test() -> None:
        broadcaster, _ = hub(interval=0.0)
        await broadcaster.wait_for_move(7, 0.0)
        broadcaster.on_message(*planning(action_id=6, move_state="succeeded"))
        waiting = asyncio.create_task(broadcaster.wait_for_move(7, 1000.0))
        broadcaster.on_message(*planning(action_id=6, move_state="cancelled"))
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert not waiting.done()
        broadcaster.on_message(*planning(action_id=7))
        await waiting
        await broadcaster.wait_for_move(7, 1000.0)

    run(test())


def test_a_frame_is_made_once_for_all_who_listen_and_not_at_all_for_none() -> None:
    async def test() -> None:
        broadcaster, first = hub(interval=0.0)
        second = broadcaster.join()
        made = []
        original = broadcaster.state.payload
        broadcaster.state.payload = lambda topic: made.append(topic) or original(topic)  # type: ignore[method-assign,func-returns-value]
        broadcaster.on_message(*pose(1.0))
        assert not made
        first.change(["/tracked_pose"])
        second.change(["/tracked_pose"])
        broadcaster.on_message(*pose(2.0))
        assert made == ["/tracked_pose"]
        assert sent(first) == sent(second) != []

    run(test())


def test_what_json_cannot_carry_is_not_sent_and_stops_nothing() -> None:
    async def test() -> None:
        broadcaster, client = hub(interval=0.0)
        client.change(["/map/info"])
        foreign = messages.current_map()
        assert foreign.map is not None
        for odd in ({"features": b"bytes"}, {"features": float("nan")}):
            spoilt = foreign.model_copy(update={"map": foreign.map.model_copy(update={"overlays": odd})})
            broadcaster.on_message(topics.MAP, spoilt)
        assert sent(client) == []
        broadcaster.on_message(topics.MAP, foreign)
        assert [frame["topic"] for frame in sent(client)] == ["/map/info"]

    run(test())


def test_what_a_real_robot_repeats_comes_again_when_nothing_changes() -> None:
    async def test() -> None:
        made = Hub(RobotState("amr1"), lambda _topic: 0, repeat_after=0.02)
        client = made.join()
        client.change(["/planning_state", "/tracked_pose"])
        made.on_message(*planning(move_state="succeeded"))
        made.on_message(*pose(1))
        again: list[str] = []
        while again.count("/planning_state") < 3:
            again.append(json.loads(await client.outbox.next())["topic"])
        assert again.count("/tracked_pose") == 1
        made.close()
        sent(client)
        await asyncio.sleep(0.1)
        assert sent(client) == []

    run(test())
