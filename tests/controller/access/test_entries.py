"""The waiting list: order, expiry, room."""

from __future__ import annotations

from rackhand.services.controller.access.entries import Entry, WaitingList


def entry(client: str, priority: int = 10, refreshed: int = 0) -> Entry:
    return Entry(client, priority, keep_alive_ns=100, on_loss="softStop", refreshed=refreshed)


def test_the_smallest_number_is_first_and_of_equals_the_one_that_came_first() -> None:
    waiting = WaitingList(8)
    assert waiting.first(0) is None
    for each in (entry("a", 20), entry("b"), entry("c"), entry("b")):
        waiting.add(each, 0)
    assert waiting.first(0) == entry("b")
    assert waiting.remove("b", 10) and not waiting.remove("b", 10)
    assert waiting.first(0) == entry("c")


def test_what_has_expired_is_never_first() -> None:
    waiting = WaitingList(8)
    waiting.add(entry("old", 1), 0)
    waiting.add(entry("young", 2, refreshed=50), 50)
    assert waiting.first(100) == entry("old", 1)
    assert waiting.first(101) == entry("young", 2, refreshed=50)
    assert waiting.first(151) is None


def test_a_full_list_makes_room_from_what_has_expired_only() -> None:
    waiting = WaitingList(2)
    waiting.add(entry("a"), 0)
    waiting.add(entry("b", refreshed=60), 60)
    waiting.add(entry("late", 1, refreshed=90), 90)
    assert waiting.first(90) == entry("a"), "both are fresh, so there was no room"
    waiting.add(entry("a", refreshed=95), 95)
    assert waiting.remove("a", 10), "an entry of the list is refreshed"
    waiting.add(entry("c", refreshed=95), 95)
    waiting.add(entry("d", 1, refreshed=170), 170)
    assert waiting.first(170) == entry("d", 1, refreshed=170), "b has expired"


def test_a_client_leaves_with_all_its_priorities() -> None:
    waiting = WaitingList(8)
    for each in (entry("a", 1), entry("a", 2), entry("b", 3)):
        waiting.add(each, 0)
    waiting.remove_client("a")
    assert waiting.first(0) == entry("b", 3)
