"""Clients and the sessions they use."""

from __future__ import annotations

from rackhand.schemas.motion import CONNECTION
from rackhand.services.controller.protocol.sessions import MAX_CONNECTIONS, Sessions, alias
from tests.controller.protocol.bench import PATH, Bench

ONE, OTHER = CONNECTION + "1", CONNECTION + "2"


def test_a_client_is_gone_with_the_last_of_its_connections() -> None:
    for first, last in ((ONE, OTHER), (OTHER, ONE)):
        sessions = Sessions(8)
        sessions.remember("cell", ONE)
        sessions.remember("cell", OTHER)
        sessions.remember("other", first)
        assert sessions.forget(first) == ["other", alias(first)]
        assert sessions.forget(last) == ["cell", alias(last)]
        assert sessions.forget(last) == [alias(last)]


def test_of_sessions_that_are_never_closed_the_last_used_counts() -> None:
    sessions = Sessions(8)
    sessions.remember("cell", "http")
    sessions.remember("cell", ONE)
    assert sessions.forget(ONE) == ["cell", alias(ONE)], "it was seen over HTTP once, long ago"
    sessions.remember("cell", ONE)
    sessions.remember("cell", "http")
    assert sessions.forget(ONE) == [alias(ONE)], "it goes on over HTTP"


def test_a_client_of_many_connections_does_not_fill_the_memory() -> None:
    sessions = Sessions(8)
    for i in range(3 * MAX_CONNECTIONS):
        sessions.remember("cell", f"{CONNECTION}{i}")
    newest = [f"{CONNECTION}{i}" for i in range(2 * MAX_CONNECTIONS, 3 * MAX_CONNECTIONS)]
    assert all("cell" not in sessions.forget(each) for each in newest[:-1])
    assert "cell" in sessions.forget(newest[-1])


def test_events_of_a_client_without_a_name_go_to_its_session() -> None:
    sessions = Sessions(8)
    sessions.remember(alias("ws1"), "ws1")
    assert sessions.recipient(alias("ws1")) == "ws1"
    assert sessions.recipient("cell") == "cell"


def test_the_oldest_client_is_dropped_for_a_new_one() -> None:
    sessions = Sessions(2)
    for client in ("a", "b", "a", "c"):
        sessions.remember(client, f"of-{client}")
    assert sessions.forget("of-b") == [alias("of-b")], "b was the one not seen for longest"
    assert sessions.forget("of-a") == ["a", alias("of-a")]


def test_a_second_connection_that_is_closed_stops_nothing() -> None:
    """A window for watching, closed while the first connection drives; and the other way round."""
    bench = Bench()
    bench.ask(ONE, **PATH, client="cell")
    bench.ask(OTHER, command="getStatus", client="cell")
    bench.take(bench.dispatcher.disconnected(OTHER, bench.now))
    assert bench.queue and bench.dispatcher.access.priority_under_control == 10
    bench.ask(OTHER, command="getStatus", client="cell")
    bench.take(bench.dispatcher.disconnected(ONE, bench.now))
    assert bench.queue and bench.dispatcher.access.priority_under_control == 10
    bench.take(bench.dispatcher.disconnected(OTHER, bench.now))
    assert not bench.queue and bench.dispatcher.access.priority_under_control == 0
