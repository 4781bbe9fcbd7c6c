"""Clients and the sessions they were last seen on."""

from __future__ import annotations

from rackhand.services.controller.protocol.sessions import Sessions, alias


def test_a_client_is_gone_with_the_last_session_it_used() -> None:
    sessions = Sessions(8)
    sessions.remember("cell", "ws1")
    sessions.remember("cell", "ws2")
    sessions.remember("other", "ws1")
    assert sessions.forget("ws1") == ["other", alias("ws1")]
    assert sessions.forget("ws2") == ["cell", alias("ws2")]
    assert sessions.forget("ws2") == [alias("ws2")]


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
