"""When the world goes on: lockstep, pacing, waiting, pausing. Wall time is a number here."""

from __future__ import annotations

import pytest

from rackhand.schemas.service import ServiceId
from rackhand.services.sim.pacing import Decision, Pacer

MS = 1_000_000
INSTANT = 20 * MS
PERIOD = 40 * MS
PLANNER = ServiceId("planner", "amr1")


def kinds(pacer: Pacer, stamp: int, *walls: float) -> list[str]:
    return [pacer.decide(stamp, now).kind for now in walls]


def run_until_wait(pacer: Pacer, stamp: int, now: float = 0.0) -> int:
    """Step as long as it may; the stamp at which it stands."""
    for _ in range(1000):
        if pacer.decide(stamp, now).kind != "step":
            return stamp
        stamp += INSTANT
    return stamp


def test_alone_at_full_speed_it_never_waits() -> None:
    assert run_until_wait(Pacer(INSTANT, speed=None), 0) == 1000 * INSTANT


def test_awaited_participants_hold_time_at_zero() -> None:
    pacer = Pacer(INSTANT, speed=None, awaited=(PLANNER,))
    assert kinds(pacer, 0, 0.0, 0.4, 0.6, 0.7, 1.2) == ["wait", "wait", "retell", "wait", "retell"]
    assert pacer.missing(0) == [PLANNER]
    pacer.join(PLANNER, PERIOD, 0)
    assert pacer.decide(0, 1.3) == Decision("step")


def test_awaited_participants_matter_at_zero_only() -> None:
    pacer = Pacer(INSTANT, speed=None, awaited=(PLANNER,))
    assert pacer.decide(0, 0.0).kind == "wait"
    assert pacer.decide(INSTANT, 0.0).kind == "step"


def test_lockstep_waits_at_each_period_for_the_answer_to_it() -> None:
    pacer = Pacer(INSTANT, speed=None, lockstep=True)
    pacer.join(PLANNER, PERIOD, 0)
    assert pacer.decide(0, 0.0).kind == "wait"
    pacer.answered("amr1", 0)
    assert run_until_wait(pacer, 0) == PERIOD
    pacer.answered("amr1", PERIOD - 1)
    assert pacer.decide(PERIOD, 0.0).kind == "wait"
    pacer.answered("amr1", PERIOD)
    assert run_until_wait(pacer, PERIOD) == 2 * PERIOD


def test_lockstep_tells_the_instant_again_after_half_a_second_and_never_gives_up() -> None:
    pacer = Pacer(INSTANT, speed=None, lockstep=True)
    pacer.join(PLANNER, PERIOD, 0)
    assert kinds(pacer, 0, 10.0, 10.49, 10.5, 10.6, 11.0, 99.0) == [
        "wait",
        "wait",
        "retell",
        "wait",
        "retell",
        "retell",
    ]


def test_lockstep_goes_on_without_who_has_gone() -> None:
    pacer = Pacer(INSTANT, speed=None, lockstep=True)
    pacer.join(PLANNER, PERIOD, 0)
    assert pacer.decide(0, 0.0).kind == "wait"
    assert pacer.leave(PLANNER)
    assert not pacer.leave(PLANNER)
    assert pacer.decide(0, 0.0).kind == "step"


def test_lockstep_waits_for_every_participant() -> None:
    second = ServiceId("planner", "amr2")
    pacer = Pacer(INSTANT, speed=None, lockstep=True)
    pacer.join(PLANNER, PERIOD, 0)
    pacer.join(second, INSTANT, 0)
    pacer.answered("amr1", 0)
    assert pacer.missing(0) == [second]
    pacer.answered("amr2", 0)
    assert run_until_wait(pacer, 0) == INSTANT


def test_running_free_nobody_falls_behind_60_ms() -> None:
    pacer = Pacer(INSTANT, speed=None)
    pacer.join(PLANNER, PERIOD, 0)
    assert run_until_wait(pacer, 0) == 60 * MS
    pacer.answered("amr1", 40 * MS)
    assert run_until_wait(pacer, 60 * MS) == 100 * MS


def test_running_free_the_wait_is_bounded_and_ends_with_the_next_answer() -> None:
    pacer = Pacer(INSTANT, speed=None)
    pacer.join(PLANNER, PERIOD, 0)
    assert kinds(pacer, 60 * MS, 0.0, 0.4, 0.6, 0.99, 1.01) == ["wait", "wait", "retell", "wait", "step"]
    assert run_until_wait(pacer, 80 * MS, 1.01) > 10_000 * MS, "it is not waited for at each instant anew"
    pacer.answered("amr1", 20_000 * MS)
    assert run_until_wait(pacer, 20_000 * MS, 2.0) == 20_060 * MS


def test_who_joins_late_has_its_time_from_then() -> None:
    pacer = Pacer(INSTANT, speed=None)
    pacer.join(PLANNER, PERIOD, 1000 * MS)
    assert run_until_wait(pacer, 1000 * MS) == 1060 * MS


@pytest.mark.parametrize("speed", [0.1, 1.0, 8.0])
def test_it_keeps_to_the_wall_at_any_speed(speed: float) -> None:
    pacer = Pacer(INSTANT, speed=speed)
    now, stamp = 100.0, 0
    while stamp < 2000 * MS:
        decision = pacer.decide(stamp, now)
        if decision.kind == "step":
            stamp += INSTANT
        now += decision.seconds
    assert now - 100.0 == pytest.approx(2.0 / speed, rel=1e-6)


def test_a_late_world_does_not_rush() -> None:
    pacer = Pacer(INSTANT, speed=1.0)
    assert pacer.decide(0, 0.0).kind == "wait"
    assert pacer.decide(0, 5.0).kind == "step"
    assert pacer.decide(INSTANT, 5.0).seconds == pytest.approx(0.02)


def test_a_slightly_late_world_catches_up_and_does_so_little_faster_than_its_pace() -> None:
    pacer = Pacer(INSTANT, speed=1.0)
    stamp, stepped = 0, []
    pacer.decide(0, 0.0)
    now = 0.1
    while stamp < 500 * MS:
        decision = pacer.decide(stamp, now)
        if decision.kind == "step":
            stamp += INSTANT
            stepped.append(now)
        now += decision.seconds
    late, in_time = [0.1 + i * 0.016 for i in range(20)], [0.42 + i * 0.02 for i in range(5)]
    assert stepped == pytest.approx(late + in_time)


def test_changing_the_speed_counts_from_now() -> None:
    pacer = Pacer(INSTANT, speed=0.1)
    pacer.decide(0, 0.0)
    pacer.speed = 1.0
    assert pacer.decide(0, 0.1).seconds == pytest.approx(0.02)


def test_a_paused_world_stands_and_tells_its_clock_twice_a_second() -> None:
    pacer = Pacer(INSTANT, speed=None, paused=True)
    assert kinds(pacer, 0, 0.0, 0.4, 0.5, 0.9, 1.0) == ["wait", "wait", "tell_clock", "wait", "tell_clock"]
    pacer.pause(False)
    assert pacer.decide(0, 1.1).kind == "step"


def test_a_paused_world_advances_so_far_and_stands_again() -> None:
    pacer = Pacer(INSTANT, speed=None, paused=True)
    pacer.advance(100 * MS)
    assert run_until_wait(pacer, 0) == 100 * MS
    assert pacer.until is None and pacer.paused


def test_advancing_in_lockstep_waits_for_answers() -> None:
    pacer = Pacer(INSTANT, speed=None, lockstep=True, paused=True)
    pacer.join(PLANNER, PERIOD, 0)
    pacer.advance(100 * MS)
    assert run_until_wait(pacer, 0) == 0
    pacer.answered("amr1", 0)
    assert run_until_wait(pacer, 0) == PERIOD
    assert pacer.until == 100 * MS


def test_advancing_in_lockstep_ends_once_the_last_instant_is_answered() -> None:
    pacer = Pacer(INSTANT, speed=None, lockstep=True, paused=True)
    pacer.join(PLANNER, PERIOD, 0)
    pacer.advance(PERIOD)
    pacer.answered("amr1", 0)
    assert run_until_wait(pacer, 0) == PERIOD
    assert pacer.until == PERIOD
    assert kinds(pacer, PERIOD, 0.0, 0.6) == ["wait", "retell"]
    pacer.answered("amr1", PERIOD)
    assert pacer.decide(PERIOD, 0.7).kind == "wait"
    assert pacer.until is None and pacer.paused


def test_beginning_anew_waits_for_all_who_took_part() -> None:
    pacer = Pacer(INSTANT, speed=None)
    pacer.join(PLANNER, PERIOD, 0)
    pacer.answered("amr1", 500 * MS)
    pacer.reset()
    assert pacer.missing(0) == [PLANNER] and pacer.answers == {}
    pacer.join(PLANNER, PERIOD, 0)
    assert pacer.missing(0) == []
    pacer.reset()
    pacer.leave(PLANNER)
    assert pacer.missing(0) == [], "who took part and has died is not waited for"


def test_who_was_awaited_from_the_start_is_awaited_even_when_dead() -> None:
    pacer = Pacer(INSTANT, speed=None, awaited=(PLANNER,))
    pacer.leave(PLANNER)
    assert pacer.missing(0) == [PLANNER]
