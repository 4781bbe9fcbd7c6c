"""Events reach the handler that was registered for their topic or query, and nothing else."""

from __future__ import annotations

import threading
from typing import Any, cast

import pytest

from rackhand.bus import Bus, Handlers, Inbox, Presence, Request, Sample
from rackhand.schemas import topics
from rackhand.schemas.moves import ListMoves, MoveReply, MoveRequest, PlanningState
from rackhand.schemas.refusal import RefusalCode
from rackhand.schemas.service import BusStats, ServiceId


class Asked(Request[MoveRequest, MoveReply]):
    """A request that no session sent; it remembers how it was refused."""

    def __init__(self) -> None:
        self.query, self.robot, self.message = topics.MOVES, "amr1", MoveRequest(request=ListMoves())
        self.refused: tuple[str, str] | None = None

    def refuse(self, code: RefusalCode, text: str) -> None:
        self.refused = (code, text)

    def __del__(self) -> None:
        pass


def ignore(*_: object) -> None: ...


def test_a_message_reaches_the_handler_of_its_topic_with_its_robot() -> None:
    handlers, seen = Handlers(), []
    handlers.on(topics.PLANNING_STATE, lambda robot, state: seen.append((robot, state.action_id)))
    handlers.on(topics.BUS_STATS, ignore)
    handlers.dispatch(Sample(topics.PLANNING_STATE, "amr2", PlanningState(stamp=0, action_id=3)))
    handlers.dispatch(Sample(topics.BUS_STATS, "amr2", BusStats(service="sim", received=0, dropped=0, malformed=0)))
    handlers.dispatch(Sample(topics.PATH, "amr2", None))
    assert seen == [("amr2", 3)]


def test_a_topic_and_a_query_have_one_handler() -> None:
    handlers = Handlers()
    for _ in range(2):
        handlers.on(topics.PLANNING_STATE, ignore)
        handlers.on_request(topics.MOVES, ignore)
    with pytest.raises(ValueError, match="planning_state already has a handler"):
        handlers.on(topics.PLANNING_STATE, lambda *_: None)
    with pytest.raises(ValueError, match="moves/command already has a handler"):
        handlers.on_request(topics.MOVES, lambda *_: None)


def test_a_request_without_a_handler_is_refused() -> None:
    handlers, seen, request = Handlers(), [], Asked()
    handlers.dispatch(request)
    assert request.refused == ("internal", "moves/command has no handler")
    handlers.on_request(topics.MOVES, lambda asked: seen.append(asked.message.request.op))
    handlers.dispatch(Asked())
    assert seen == ["list"]


def test_presence_is_dispatched_by_service() -> None:
    handlers, seen = Handlers(), []
    planner = ServiceId("planner", "amr1")
    handlers.dispatch(Presence(planner, True))
    handlers.on_presence(lambda service, alive: seen.append((service, alive)))
    handlers.dispatch(Presence(planner, False))
    assert seen == [(planner, False)]


def test_what_another_thread_posts_is_handled_in_the_reader_s_thread_in_order() -> None:
    inbox = Inbox(cast(Bus, None))
    seen: list[tuple[int, int]] = []
    post = inbox.poster(lambda number: seen.append((number, threading.get_ident())))
    poster = threading.Thread(target=lambda: [post(number) for number in range(2000)])
    poster.start()
    for _ in range(2000):
        event: Any = inbox.get(timeout=20)
        inbox.dispatch(event)
    poster.join()
    assert seen == [(number, threading.get_ident()) for number in range(2000)], "none dropped, whatever their number"
