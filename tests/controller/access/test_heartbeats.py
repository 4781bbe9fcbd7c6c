"""Heartbeats expire once, after a silence longer than their period."""

from __future__ import annotations

from rackhand.services.controller.access.heartbeats import Heartbeats


def test_a_silence_longer_than_the_period_is_reported_once() -> None:
    beats = Heartbeats(8)
    assert beats.start("a", 100, 0)
    assert beats.expired(100) == []
    beats.beat("a", 90)
    assert beats.expired(190) == [] and "a" in beats
    assert beats.expired(191) == ["a"] and "a" not in beats
    assert beats.expired(1000) == []


def test_a_stopped_one_never_expires_and_a_second_start_changes_the_period() -> None:
    beats = Heartbeats(8)
    beats.start("a", 100, 0)
    beats.start("b", 100, 0)
    beats.start("b", 500, 50)
    beats.stop("a")
    beats.stop("a")
    assert beats.expired(550) == [] and beats.expired(551) == ["b"]


def test_there_is_room_for_so_many_clients() -> None:
    beats = Heartbeats(2)
    assert beats.start("a", 1, 0) and beats.start("b", 1, 0) and not beats.start("c", 1, 0)
    assert beats.start("a", 2, 0), "one that is watched already needs no room"
    assert len(beats) == 2
