"""When the simulation takes its next step: lockstep, pacing, waiting, pausing. Wall time is a number here."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.schemas.service import ServiceId
from rackhand.services.sim.pacing import CommandSchedule, Decision, Pacer

MS = 1_000_000
STEP = 20 * MS
PERIOD = 40 * MS
PLANNER = ServiceId("planner", "amr1")


def kinds(pacer: Pacer, stamp: int, *walls: float) -> list[str]:
    return [pacer.decide(stamp, now).kind for now in walls]


def run_until_wait(pacer: Pacer, stamp: int, now: float = 0.0) -> int:
    """Step as long as it may; the stamp at which it waits."""
    for _ in range(1000):
        if pacer.decide(stamp, now).kind != "step":
            return stamp
        stamp += STEP
    return stamp


def test_alone_at_full_speed_it_never_waits() -> None:
    assert run_until_wait(Pacer(STEP, speed=None), 0) == 1000 * STEP


def test_awaited_participants_hold_time_at_zero() -> None:
    pacer = Pacer(STEP, speed=None, awaited=(PLANNER,))
    assert kinds(pacer, 0, 0.0, 0.4, 0.6, 0.7, 1.2) == ["wait", "wait", "republish", "wait", "republish"]
    assert pacer.missing(0) == [PLANNER]
    pacer.join(PLANNER, PERIOD, 0)
    assert pacer.decide(0, 1.3) == Decision("step")


def test_awaited_participants_matter_at_zero_only() -> None:
    pacer = Pacer(STEP, speed=None, awaited=(PLANNER,))
    assert pacer.decide(0, 0.0).kind == "wait"
    assert pacer.decide(STEP, 0.0).kind == "step"


def test_lockstep_waits_at_each_period_for_the_answer_to_it() -> None:
    pacer = Pacer(STEP, speed=None, lockstep=True)
    pacer.join(PLANNER, PERIOD, 0)
    assert pacer.decide(0, 0.0).kind == "wait"
    pacer.answered("amr1", 0)
    assert run_until_wait(pacer, 0) == PERIOD
    pacer.answered("amr1", PERIOD - 1)
    assert pacer.decide(PERIOD, 0.0).kind == "wait"
    pacer.answered("amr1", PERIOD)
    assert run_until_wait(pacer, PERIOD) == 2 * PERIOD


def test_lockstep_republishes_after_half_a_second_and_never_gives_up() -> None:
    pacer = Pacer(STEP, speed=None, lockstep=True)
    pacer.join(PLANNER, PERIOD, 0)
    assert kinds(pacer, 0, 10.0, 10.49, 10.5, 10.6, 11.0, 99.0) == [
        "wait",
        "wait",
        "republish",
        "wait",
        "republish",
        "republish",
    ]


def test_lockstep_continues_without_a_participant_that_has_gone() -> None:
    pacer = Pacer(STEP, speed=None, lockstep=True)
    pacer.join(PLANNER, PERIOD, 0)
    assert pacer.decide(0, 0.0).kind == "wait"
    assert pacer.leave(PLANNER)
    assert not pacer.leave(PLANNER)
    assert pacer.decide(0, 0.0).kind == "step"


def test_lockstep_waits_for_every_participant() -> None:
    second = ServiceId("planner", "amr2")
    pacer = Pacer(STEP, speed=None, lockstep=True)
    pacer.join(PLANNER, PERIOD, 0)
    pacer.join(second, STEP, 0)
    pacer.answered("amr1", 0)
    assert pacer.missing(0) == [second]
    pacer.answered("amr2", 0)
    assert run_until_wait(pacer, 0) == STEP


def test_running_free_nobody_falls_behind_60_ms() -> None:
    pacer = Pacer(STEP, speed=None)
    pacer.join(PLANNER, PERIOD, 0)
    assert run_until_wait(pacer, 0) == 60 * MS
    pacer.answered("amr1", 40 * MS)
    assert run_until_wait(pacer, 60 * MS) == 100 * MS


def test_running_free_the_wait_is_bounded_and_ends_with_the_next_answer() -> None:
    pacer = Pacer(STEP, speed=None)
    pacer.join(PLANNER, PERIOD, 0)
    assert kinds(pacer, 60 * MS, 0.0, 0.4, 0.6, 0.99, 1.01) == ["wait", "wait", "republish", "wait", "step"]
    assert run_until_wait(pacer, 80 * MS, 1.01) > 10_000 * MS, "it is not waited for again at each step"
    pacer.answered("amr1", 20_000 * MS)
    assert run_until_wait(pacer, 20_000 * MS, 2.0) == 20_060 * MS


def test_a_participant_that_joins_late_is_waited_for_from_then() -> None:
    pacer = Pacer(STEP, speed=None)
    pacer.join(PLANNER, PERIOD, 1000 * MS)
    assert run_until_wait(pacer, 1000 * MS) == 1060 * MS


@pytest.mark.parametrize("speed", [0.1, 1.0, 8.0])
def test_it_keeps_to_the_wall_clock_at_any_speed(speed: float) -> None:
    pacer = Pacer(STEP, speed=speed)
    now, stamp = 100.0, 0
    while stamp < 2000 * MS:
        decision = pacer.decide(stamp, now)
        if decision.kind == "step":
            stamp += STEP
        now += decision.seconds
    assert now - 100.0 == pytest.approx(2.0 / speed, rel=1e-6)


def test_a_simulation_that_is_late_does_not_rush() -> None:
    pacer = Pacer(STEP, speed=1.0)
    assert pacer.decide(0, 0.0).kind == "wait"
    assert pacer.decide(0, 5.0).kind == "step"
    assert pacer.decide(STEP, 5.0).seconds == pytest.approx(0.02)


def test_a_slightly_late_simulation_catches_up_a_little_faster_than_its_pace() -> None:
    pacer = Pacer(STEP, speed=1.0)
    stamp, stepped = 0, []
    pacer.decide(0, 0.0)
    now = 0.1
    while stamp < 500 * MS:
        decision = pacer.decide(stamp, now)
        if decision.kind == "step":
            stamp += STEP
            stepped.append(now)
        now += decision.seconds
    late, in_time = [0.1 + i * 0.016 for i in range(20)], [0.42 + i * 0.02 for i in range(5)]
    assert stepped == pytest.approx(late + in_time)


def test_changing_the_speed_counts_from_now() -> None:
    pacer = Pacer(STEP, speed=0.1)
    pacer.decide(0, 0.0)
    pacer.speed = 1.0
    assert pacer.decide(0, 0.1).seconds == pytest.approx(0.02)


def test_a_paused_simulation_publishes_its_clock_twice_a_second() -> None:
    pacer = Pacer(STEP, speed=None, paused=True)
    assert kinds(pacer, 0, 0.0, 0.4, 0.5, 0.9, 1.0) == ["wait", "wait", "publish_clock", "wait", "publish_clock"]
    pacer.pause(False)
    assert pacer.decide(0, 1.1).kind == "step"


def test_a_paused_simulation_advances_to_a_stamp_and_pauses_again() -> None:
    pacer = Pacer(STEP, speed=None, paused=True)
    pacer.advance(100 * MS)
    assert run_until_wait(pacer, 0) == 100 * MS
    assert pacer.until is None and pacer.paused


def test_advancing_in_lockstep_waits_for_answers() -> None:
    pacer = Pacer(STEP, speed=None, lockstep=True, paused=True)
    pacer.join(PLANNER, PERIOD, 0)
    pacer.advance(100 * MS)
    assert run_until_wait(pacer, 0) == 0
    pacer.answered("amr1", 0)
    assert run_until_wait(pacer, 0) == PERIOD
    assert pacer.until == 100 * MS


def test_advancing_in_lockstep_ends_once_the_last_step_is_answered() -> None:
    pacer = Pacer(STEP, speed=None, lockstep=True, paused=True)
    pacer.join(PLANNER, PERIOD, 0)
    pacer.advance(PERIOD)
    pacer.answered("amr1", 0)
    assert run_until_wait(pacer, 0) == PERIOD
    assert pacer.until == PERIOD
    assert kinds(pacer, PERIOD, 0.0, 0.6) == ["wait", "republish"]
    pacer.answered("amr1", PERIOD)
    assert pacer.decide(PERIOD, 0.7).kind == "wait"
    assert pacer.until is None and pacer.paused


def test_a_reset_waits_for_all_participants_to_join_again() -> None:
    pacer = Pacer(STEP, speed=None)
    pacer.join(PLANNER, PERIOD, 0)
    pacer.answered("amr1", 500 * MS)
    pacer.reset()
    assert pacer.missing(0) == [PLANNER] and pacer.answers == {}
    pacer.join(PLANNER, PERIOD, 0)
    assert pacer.missing(0) == []
    pacer.reset()
    pacer.leave(PLANNER)
    assert pacer.missing(0) == [], "a participant that has gone is not waited for"


def test_a_participant_awaited_from_the_start_is_awaited_even_when_it_has_gone() -> None:
    pacer = Pacer(STEP, speed=None, awaited=(PLANNER,))
    pacer.leave(PLANNER)
    assert pacer.missing(0) == [PLANNER]


# -- command latency: the answer to t takes effect at t + latency ----------------------------------------------------


class Toy:
    """A pacer, its schedule and a machine that records which answer drives each control step."""

    def __init__(self, latency: int, period: int = PERIOD, step: int = STEP, **settings: Any) -> None:
        self.pacer = Pacer(step, **({"speed": None, "lockstep": True} | settings))
        self.schedule: CommandSchedule[int] = CommandSchedule()
        self.stamp, self.step_ns, self.period, self.latency = 0, step, period, latency * period
        self.in_force: int | None = None
        self.driven: dict[int, int | None] = {}

    def join(self) -> None:
        self.pacer.join(PLANNER, self.period, self.stamp, self.latency)

    def answer(self, stamp: int) -> None:
        effective = self.pacer.effective("amr1", stamp)
        if effective is not None:
            self.schedule.add("amr1", effective, stamp)
            self.pacer.answered("amr1", stamp)

    def run(self, now: float = 0.0) -> int:
        """Step as long as it may; the stamp at which it waits."""
        while self.pacer.decide(self.stamp, now).kind == "step":
            for _, command in self.schedule.take_due(self.stamp):
                self.in_force = command
            self.driven[self.stamp] = self.in_force
            self.stamp += self.step_ns
        return self.stamp

    def reset(self) -> None:
        self.pacer.reset()
        self.schedule.clear()
        self.stamp, self.in_force, self.driven = 0, None, {}


@pytest.mark.parametrize("latency", [0, 1, 2, 3])
def test_time_runs_ahead_of_the_answers_by_the_command_latency(latency: int) -> None:
    toy = Toy(latency)
    toy.join()
    assert toy.run() == latency * PERIOD
    toy.answer(0)
    assert toy.run() == (latency + 1) * PERIOD
    toy.answer(PERIOD)
    assert toy.run() == (latency + 2) * PERIOD


@pytest.mark.parametrize("latency", [0, 1, 2])
@pytest.mark.parametrize("ahead", [0, 1, 2])
def test_an_answer_takes_effect_at_its_step_exactly_however_early_it_comes(latency: int, ahead: int) -> None:
    """``ahead``: how many periods before it is needed each answer arrives, as far as its state has been published."""
    toy = Toy(latency)
    toy.join()
    given = 0
    while toy.stamp < 10 * PERIOD:
        toy.run()
        needed = toy.stamp - latency * PERIOD
        while given <= min(toy.stamp, needed + ahead * PERIOD):
            toy.answer(given)
            given += PERIOD
    expected = {
        stamp: stamp // PERIOD * PERIOD - latency * PERIOD if stamp >= latency * PERIOD else None
        for stamp in toy.driven
    }
    assert len(expected) >= 20 and toy.driven == expected


def test_a_late_answer_is_waited_for_and_takes_effect_at_the_same_step() -> None:
    toy = Toy(latency=1)
    toy.join()
    toy.answer(0)
    assert toy.run(now=0.0) == 2 * PERIOD
    assert toy.run(now=99.0) == 2 * PERIOD
    toy.answer(PERIOD)
    toy.run(now=100.0)
    assert [toy.driven[stamp] for stamp in (PERIOD, PERIOD + STEP, 2 * PERIOD)] == [0, 0, PERIOD]


def test_a_repeated_answer_changes_nothing() -> None:
    toy = Toy(latency=1)
    toy.join()
    toy.answer(0)
    toy.answer(PERIOD)
    toy.run()
    toy.answer(0)
    assert toy.schedule.take_due(99 * PERIOD) == []
    assert toy.run() == 3 * PERIOD


def test_a_short_period_and_a_long_one_each_with_its_own_latency() -> None:
    arm = ServiceId("controller", "arm1")
    pacer = Pacer(2 * MS, speed=None, lockstep=True)
    pacer.join(PLANNER, PERIOD, 0, PERIOD)
    pacer.join(arm, 4 * MS, 0, 4 * MS)
    waits: list[tuple[int, list[ServiceId]]] = []
    stamp = 0
    while stamp < 90 * MS:
        if pacer.decide(stamp, 0.0).kind == "step":
            stamp += 2 * MS
            continue
        missing = pacer.missing(stamp)
        waits.append((stamp, missing))
        for service in missing:
            latency = pacer.participants[service].latency_ns
            pacer.answered(service.robot, stamp - latency)
    assert [s for s, missing in waits if arm in missing] == list(range(4 * MS, 90 * MS, 4 * MS))
    assert [s for s, missing in waits if PLANNER in missing] == [40 * MS, 80 * MS]


def test_a_participant_that_joins_during_a_run_is_waited_for_from_its_first_period_on() -> None:
    toy = Toy(latency=1)
    toy.stamp = 5 * STEP  # 100 ms, within a period
    toy.join()
    assert toy.run() == 160 * MS, "the first period after joining begins at 120 ms"
    toy.answer(120 * MS)
    assert toy.run() == 200 * MS
    assert toy.driven[140 * MS] is None and toy.driven[160 * MS] == 120 * MS


def test_joining_again_neither_forgets_answers_nor_excuses_from_them() -> None:
    toy = Toy(latency=1)
    toy.join()
    toy.run()
    toy.join()  # its first declaration was answered too late for it
    assert toy.pacer.missing(toy.stamp) == [PLANNER]
    toy.answer(0)
    toy.join()
    assert toy.run() == 2 * PERIOD


def test_a_participant_that_leaves_and_comes_back_answers_from_then_on() -> None:
    toy = Toy(latency=1)
    toy.join()
    toy.answer(0)
    toy.answer(PERIOD)
    assert toy.run() == 3 * PERIOD
    assert toy.pacer.leave(PLANNER)
    toy.schedule.drop("amr1")
    toy.join()
    assert toy.run() == 4 * PERIOD, "the answer to 2 periods is owed by nobody, that to 3 by the one that came back"
    toy.answer(3 * PERIOD)
    assert toy.run() == 5 * PERIOD
    assert toy.driven[4 * PERIOD] == 3 * PERIOD


def test_a_reset_drops_what_waits_and_begins_with_the_latency_again() -> None:
    toy = Toy(latency=1)
    toy.join()
    toy.answer(0)
    toy.run()
    toy.answer(PERIOD)
    toy.reset()
    assert toy.run() == 0
    toy.join()
    assert toy.run() == PERIOD
    assert set(toy.driven.values()) == {None}
    toy.answer(0)
    assert toy.run() == 2 * PERIOD and toy.driven[PERIOD] == 0


def test_an_advance_ends_once_its_last_step_is_answered_whatever_the_latency() -> None:
    toy = Toy(latency=1, paused=True)
    toy.join()
    toy.pacer.advance(2 * PERIOD)
    toy.answer(0)
    assert toy.run() == 2 * PERIOD
    assert toy.pacer.until == 2 * PERIOD and toy.pacer.unanswered(toy.stamp) == [PLANNER]
    assert [toy.pacer.decide(toy.stamp, now).kind for now in (0.0, 0.6)] == ["wait", "republish"]
    toy.answer(PERIOD)
    assert toy.run() == 2 * PERIOD and toy.pacer.until == 2 * PERIOD
    toy.answer(2 * PERIOD)
    assert toy.run() == 2 * PERIOD and toy.pacer.until is None


def test_single_steps_and_a_pause_drive_the_machine_as_one_run_does() -> None:
    def answer_all(toy: Toy, first: int) -> int:
        while first <= toy.stamp:
            toy.answer(first)
            first += PERIOD
        return first

    whole, stepped = Toy(latency=1), Toy(latency=1, paused=True)
    for toy in (whole, stepped):
        toy.join()
    given = 0
    while whole.stamp < 8 * PERIOD:
        whole.run()
        given = answer_all(whole, given)
    given = 0
    while stepped.stamp < 8 * PERIOD:
        stepped.pacer.advance(stepped.stamp + STEP)
        stepped.run()
        given = answer_all(stepped, given)
        stepped.run()
        assert stepped.pacer.until is None
    assert {stamp: whole.driven[stamp] for stamp in stepped.driven} == stepped.driven
    assert len(stepped.driven) == 16


def test_running_free_a_command_is_in_force_as_it_arrives() -> None:
    pacer = Pacer(STEP, speed=None)
    pacer.join(PLANNER, PERIOD, 0, PERIOD)
    assert pacer.effective("amr1", 0) == 0
    pacer.answered("amr1", 0)
    assert pacer.effective("amr1", 0) == 0
    assert pacer.missing(PERIOD) == pacer.unanswered(PERIOD) == []
