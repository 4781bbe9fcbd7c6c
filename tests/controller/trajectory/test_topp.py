from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import linprog

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.geometry import Tolerance, joint_path
from rackhand.services.controller.trajectory.time_law import Smoothing, TimeLaw, at_rest, time_law_from
from rackhand.services.controller.trajectory.timing import Planning, plan, rows
from rackhand.services.controller.trajectory.topp import controllable, drive
from tests.controller.trajectory.arms import FR3_LIMITS, UR5E_LIMITS


def waypoints(seed: int, n: int = 5) -> Array:
    rng = np.random.default_rng(seed)
    middle, half = (FR3_LIMITS.upper + FR3_LIMITS.lower) / 2, (FR3_LIMITS.upper - FR3_LIMITS.lower) / 2
    return np.asarray(middle + half * rng.uniform(-0.8, 0.8, (n, 7)))


def test_a_straight_line_takes_the_time_of_the_textbook() -> None:
    """One joint, bang–coast–bang: T = L/v + v/a."""
    length, v, a = 2.0, float(UR5E_LIMITS.velocity[0]), float(UR5E_LIMITS.acceleration[0])
    points = np.zeros((2, 6))
    points[1, 0] = length
    planning = Planning(velocity=1.0, acceleration=1.0, grid=0.005)
    curve = joint_path(points, Tolerance()).curve()
    timed = plan(curve, rows(curve, UR5E_LIMITS, planning), planning)
    assert timed.law.end == pytest.approx(length / v + v / a, rel=1e-3)


def test_the_controllable_set_is_that_of_the_linear_programs() -> None:
    """The Newton iteration against scipy's simplex on the same two-variable programs."""
    curve = joint_path(waypoints(1), Tolerance()).curve()
    lines = rows(curve, FR3_LIMITS, Planning(grid=0.1, pieces=4))
    c = np.ones(lines.s.size)
    ceiling = 1 / lines.speed**2
    ceiling[-1] = 0.0
    beta = controllable(lines.s, lines.A, lines.B, c, ceiling)
    expected = ceiling.copy()
    for i in range(lines.s.size - 2, -1, -1):
        h = lines.s[i + 1] - lines.s[i]
        here = np.column_stack([lines.A[i], lines.B[i]])
        there = np.column_stack([lines.A[i + 1] + 2 * h * lines.B[i + 1], lines.B[i + 1]])
        after = np.array([[2 * h, 1.0]])
        A = np.vstack([here, -here, there, -there, after, -after])
        b = np.concatenate([np.ones(4 * here.shape[0]), [expected[i + 1], 0.0]])
        solved = linprog([0.0, -1.0], A, b, bounds=[(None, None), (0, ceiling[i])])
        expected[i] = solved.x[1]
    assert np.abs(beta - expected).max() < 1e-6 * ceiling.max()


def test_the_driven_phase_keeps_every_row_and_ends_at_rest() -> None:
    curve = joint_path(waypoints(2), Tolerance()).curve()
    lines = rows(curve, FR3_LIMITS, Planning())
    c, ceiling = np.ones(lines.s.size), 1 / lines.speed**2
    ceiling[-1] = 0.0
    beta = controllable(lines.s, lines.A, lines.B, c, ceiling)
    x, u, _ = drive(lines.s, lines.A, lines.B, c, beta, 0.0, 0.0, False)
    assert (x <= ceiling + 1e-9).all()
    assert x[-1] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(lines.A[:-1] * u[:, None] + lines.B[:-1] * x[:-1, None]).max() <= 1 + 1e-9
    # Time-optimal: somewhere along every stretch something is at its limit.
    busy = np.abs(lines.A[:-1] * u[:, None] + lines.B[:-1] * x[:-1, None]).max(axis=1)
    assert (np.maximum(busy, x[:-1] / ceiling[:-1]) > 0.98).mean() > 0.95


def test_braking_is_the_shortest_stop() -> None:
    """On a straight line: v²/2a."""
    points = np.zeros((2, 6))
    points[1, 0] = 3.0
    lines = rows(joint_path(points, Tolerance()).curve(), UR5E_LIMITS, Planning())
    n = lines.s.size
    _, _, end = drive(lines.s, lines.A, lines.B, np.ones(n), np.zeros(n), 4.0, 0.0, True)
    assert end == pytest.approx(4.0 / (2 * UR5E_LIMITS.acceleration[0]))


def test_the_filter_is_the_exact_average_of_the_phase() -> None:
    times, places = [1.0, 1.5, 2.5, 3.0], [0.0, 0.25, 1.25, 1.5]
    law = TimeLaw(np.array(times), np.array(places), np.array([0.0, 1, 1, 0]), np.array([2.0, 0, -2, 0]))
    smoothing = Smoothing(0.2, 0.05)
    t = np.linspace(0.9, 3.4, 251)
    fine = np.arange(0.0, 4.0, 1e-4)
    raw = np.array([law.at(x)[0] for x in fine])
    kernel = np.convolve(np.full(2000, 1 / 2000), np.full(500, 1 / 500))
    averaged = np.interp(t, fine[: raw.size], np.convolve(raw, kernel)[: raw.size])
    got = law.filtered(t, smoothing)
    # The sampled average is late by half a sample of either box: 1e-4 s at speed 1.
    assert np.abs(got[:, 0] - averaged).max() < 1.5e-4
    for order in range(3):
        slope = (law.filtered(t + 1e-5, smoothing) - law.filtered(t - 1e-5, smoothing))[:, order] / 2e-5
        assert np.abs(slope - got[:, order + 1]).max() < (2e-2 if order == 2 else 1e-6)
    assert np.abs(got[-1] - [1.5, 0, 0, 0]).max() < 1e-9


def test_a_corner_taken_at_rest_waits_for_the_filter() -> None:
    s = np.array([0.0, 0.5, 1.0, 1.0, 1.5, 2.0])
    x, u = np.array([0.0, 1, 0, 0, 1, 0]), np.array([1.0, -1, 0, 1, -1])
    law = time_law_from(0.0, s, x, u, 2.0, pause=0.1)
    assert law.end == pytest.approx(4.1)
    assert law.at(2.05) == (1.0, 0.0)


def test_what_is_cut_and_joined_is_the_same_phase() -> None:
    curve = joint_path(waypoints(3), Tolerance()).curve()
    planning = Planning()
    law = plan(curve, rows(curve, FR3_LIMITS, planning), planning).law
    head = law.cut(0.7, planning.smoothing.total)
    k = int(np.searchsorted(law.t, 0.7))
    here = zip((0.7, *law.at(0.7), law.a[k - 1]), (law.t, law.s, law.v, law.a), strict=True)
    tail = TimeLaw(*(np.concatenate([[now], row[k:]]) for now, row in here))
    t = np.arange(0.7, law.end, 0.01)
    smoothing = planning.smoothing
    assert np.abs(head.then(tail).filtered(t, smoothing) - law.filtered(t, smoothing)).max() < 1e-7


@pytest.mark.parametrize("seed", range(6))
def test_the_motion_is_near_the_bound_of_its_own_path(seed: int) -> None:
    """Filter and margins cost less than 3 % over the unfiltered optimum at the full limits, and the filter's length."""
    planning = Planning()
    curve = joint_path(waypoints(seed), Tolerance()).curve()
    lines = rows(curve, FR3_LIMITS, planning)
    bold = dataclasses.replace(planning, velocity=1.0, acceleration=1.0, rounds=0)
    bound = plan(curve, lines, bold).law.end
    timed = plan(curve, lines, planning)
    assert max(timed.use) <= 1 + planning.slack
    assert bound < timed.law.end <= 1.03 * bound


def test_a_low_jerk_limit_is_kept_by_slowing_down() -> None:
    low = dataclasses.replace(FR3_LIMITS, jerk=np.full(7, 250.0))
    planning = Planning()
    curve = joint_path(waypoints(8), Tolerance()).curve()
    timed = plan(curve, rows(curve, low, planning), planning)
    assert plan(curve, rows(curve, low, planning), dataclasses.replace(planning, rounds=0)).use[2] > 1.25
    assert timed.use[2] <= 1.02


def test_planning_is_deterministic() -> None:
    curve = joint_path(waypoints(5), Tolerance()).curve()
    first, second = (plan(curve, rows(curve, FR3_LIMITS, Planning()), Planning(), at_rest(0.0, 0.0)) for _ in range(2))
    assert np.array_equal(first.law.t, second.law.t)
    assert np.array_equal(first.law.s, second.law.s)
