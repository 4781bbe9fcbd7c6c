from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control import speed_profile as profile
from rackhand.services.planner.control.braking_guard import BrakingGuard, Surroundings, braking_is_free
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import BODY

S = NavigationSettings()
EDGES = Footprint.of(BODY).edges
FRONT = 0.375


def twist(linear: float, angular: float = 0.0) -> Twist2:
    return Twist2(linear=linear, angular=angular)


def free(v: float, obstacle: tuple[float, ...], w: float = 0.0, command: float | None = None) -> bool:
    row = np.array([[*obstacle, *(0.0,) * (4 - len(obstacle)), 0.01]])
    return braking_is_free(np.zeros(3), twist(v, w), twist(v if command is None else command, w), 0.04, row, EDGES, S)


def stopping_distance(v: float) -> float:
    return v * (0.04 + S.actuation.latency + S.actuation.lag) + v * v / 4.0


@pytest.mark.parametrize("v", [0.3, 0.6, 1.2])
def test_refuses_exactly_what_could_not_be_stopped(v: float) -> None:
    assert free(v, (FRONT + stopping_distance(v) + 0.08, 0.0))
    assert not free(v, (FRONT + stopping_distance(v) - 0.08, 0.0))


def test_what_is_beside_does_not_matter_but_what_a_turn_sweeps_does() -> None:
    assert free(1.0, (0.5, 0.26))
    assert free(0.0, (0.3, 0.32))
    assert not free(0.0, (0.3, 0.32), w=1.2)


def test_leaving_what_is_too_near_is_allowed_and_coming_nearer_is_not() -> None:
    assert free(-0.2, (FRONT + 0.002, 0.0))
    assert not free(0.05, (FRONT + 0.002, 0.0))


def test_something_that_steps_in_front_is_seen_before_it_is_there() -> None:
    assert free(1.0, (0.75, 0.8))
    assert not free(1.0, (0.75, 0.8, 0.0, -1.0))


def test_something_that_comes_at_a_chassis_leaving_does_not_stop_it() -> None:
    assert free(1.0, (-1.0, 0.0, 1.0, 0.0))


@pytest.mark.parametrize("seed", range(5))
def test_commands_keep_the_limits_whatever_is_wanted(seed: int) -> None:
    random, dt, limits = np.random.default_rng(seed), 0.04, S.control
    now = twist(0.0)
    for _ in range(500):
        wanted = random.uniform(-2, 2, 2)
        then = profile.limited(now, *wanted, dt, limits)
        check_step(now, then, dt)
        now = then


def check_step(now: Twist2, then: Twist2, dt: float) -> None:
    limits = S.control
    assert limits.max_backward_velocity <= then.linear <= limits.max_forward_velocity
    assert abs(then.angular) <= limits.max_angular_velocity
    change = (then.linear - now.linear) / dt
    speeding = abs(then.linear) > abs(now.linear)
    assert now.linear * then.linear >= 0.0
    assert abs(change) <= (limits.max_forward_acc if speeding else -limits.max_forward_decel) + 1e-9
    assert abs(then.angular - now.angular) / dt <= limits.max_angular_acc + 1e-9


def test_braking_keeps_the_arc_and_ends_at_rest() -> None:
    now, dt, steps = twist(1.2, 0.6), 0.04, 0
    while (now.linear, now.angular) != (0.0, 0.0):
        then = profile.braked(now, dt, S.control)
        check_step(now, then, dt)
        if then.linear > 0.2:
            assert then.angular / then.linear == pytest.approx(0.5)
        now, steps = then, steps + 1
        assert steps < 60
    assert steps * dt == pytest.approx(0.6, abs=0.1)


def test_braking_a_turn_on_the_spot() -> None:
    assert profile.braked(twist(0.0, 1.0), 0.04, S.control).angular == pytest.approx(1.0 - 0.06)
    assert not math.isnan(profile.braked(twist(0.0, 0.0), 0.04, S.control).angular)


FREE = Surroundings(np.zeros(3), np.empty((0, 5)))
TICK = 40_000_000


def commanded(guard: BrakingGuard, first: int, speeds: list[float], view: Surroundings | None = FREE) -> list[float]:
    """What becomes of these wanted speeds, one a tick from number ``first`` on."""
    return [
        guard.drive(twist(speed), view, guard.command, (first + k) * TICK, S.control, EDGES, S).linear
        for k, speed in enumerate(speeds)
    ]


def test_speeding_up_builds_up_and_a_stop_for_an_obstacle_does_not() -> None:
    guard, limits = BrakingGuard(), S.control
    changes = np.diff([0.0, *commanded(guard, 1, [1.2] * 40)]) / 0.04
    assert np.abs(np.diff([0.0, *changes])).max() <= limits.max_forward_acc / S.build_up * 0.04 + 1e-9
    assert changes.max() == pytest.approx(limits.max_forward_acc)
    speed = guard.command.linear
    stop = commanded(guard, 41, [1.2] * 5, None)
    assert stop == pytest.approx([speed + limits.max_forward_decel * 0.04 * (k + 1) for k in range(5)])
    assert guard.vetoed
    again = commanded(guard, 46, [1.2] * 3)
    assert np.diff([stop[-1], *again]) / 0.04 == pytest.approx([0.1, 0.2, 0.3])


def test_a_held_chassis_brakes_at_once() -> None:
    guard = BrakingGuard()
    speed = commanded(guard, 1, [1.0] * 40)[-1]
    assert guard.brake(41 * TICK, S.own).linear == pytest.approx(speed + S.own.max_forward_decel * 0.04)
