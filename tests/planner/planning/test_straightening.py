"""Straightened paths: fewer bends, no longer, and nowhere less clearance than is asked for or than there was."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.inflation import Inflation
from rackhand.services.planner.planning.lattice import Ends, Margins, Problem
from rackhand.services.planner.planning.straightening import GIVEN, KEPT_CLEARANCE, MOST_BEND, straightened
from tests.planner.plant import BODY

Array = NDArray[np.float64]
FOOTPRINT = Footprint.of(BODY)
MARGIN = 0.035


def problem(goal: tuple[float, float, float], gap: float | None = None) -> Problem:
    """A hall of 8 x 4 m from the start (1, 2); with ``gap``, two walls 0.6 m deep leave so many metres about y = 2."""
    geometry = Geometry(0.0, 0.0, 0.05, 80, 160)
    blocked = np.zeros((80, 160), dtype=np.bool_)
    blocked[[0, -1]] = True
    blocked[:, [0, -1]] = True
    if gap is not None:
        half = round(0.5 * gap / 0.05)
        blocked[: 40 - half, 74:86] = blocked[40 + half :, 74:86] = True
    ends = Ends(np.array([1.0, 2.0, 0.0]), np.array(goal), False, Margins(MARGIN, MARGIN, MARGIN))
    return Problem(
        DistanceGrid.of(blocked, geometry), np.zeros((80, 160), dtype=np.float32), FOOTPRINT,
        Inflation(FOOTPRINT.inscribed, 0.5, 4.0), ends, 1.3,
    )  # fmt: skip


def swerving(length: float, width: float, waves: int = 3) -> Array:
    """Rows from (1, 2) along x, to and fro by ``width`` metres."""
    x = np.linspace(0.0, length, round(length / 0.05) + 1)
    y = width * np.sin(np.pi * waves * x / length) ** 2
    points = np.column_stack([1.0 + x, 2.0 + y])
    steps = np.diff(points, axis=0)
    yaw = np.arctan2(steps[:, 1], steps[:, 0])
    return np.column_stack([points, [*yaw, yaw[-1]]])


def turning(rows: Array) -> float:
    """Radians."""
    return float(np.abs(np.diff(np.unwrap(rows[:, 2]))).sum())


def length(rows: Array) -> float:
    return float(np.hypot(*np.diff(rows[:, :2], axis=0).T).sum())


def clearances(where: Problem, rows: Array) -> Array:
    return np.array([where.grid.clearance(FOOTPRINT, row, KEPT_CLEARANCE) for row in rows]).clip(max=KEPT_CLEARANCE)


@pytest.mark.parametrize("gap", [None, 0.6, 0.7])
def test_swerves_become_a_line(gap: float | None) -> None:
    where, rows = problem((7.0, 2.0, 0.0), gap), swerving(6.0, 0.05)
    (straight,) = straightened(where, rows, False, 0.0, True)
    assert straight[0, :2] == pytest.approx(rows[0, :2]) and straight[-1, :2] == pytest.approx(rows[-1, :2])
    assert length(straight) <= length(rows) and turning(straight) < 0.3 * turning(rows)
    assert np.hypot(*np.diff(straight[:, :2], axis=0).T).max() <= 0.051
    assert clearances(where, straight).min() >= max(MARGIN, clearances(where, rows).min() - GIVEN) - 1e-9


def test_no_clearance_is_given_up_for_a_straighter_path() -> None:
    """A line from beside the gap to its far end is free by the margin alone; the path went through its middle."""
    where = problem((7.0, 2.3, 0.0), 0.7)
    rows = np.vstack([
        np.column_stack([np.linspace(1.0, 3.2, 45), np.linspace(2.0, 2.0, 45), np.zeros(45)]),
        np.column_stack([np.linspace(3.25, 4.8, 32), np.full(32, 2.0), np.zeros(32)]),
        np.column_stack([np.linspace(4.85, 7.0, 44), np.linspace(2.0, 2.3, 44), np.full(44, math.atan2(0.3, 2.15))]),
    ])  # fmt: skip
    (straight,) = straightened(where, rows, False, None, True)
    assert clearances(where, straight).min() >= clearances(where, rows).min() - GIVEN - 1e-9


@pytest.mark.parametrize("backward", [False, True])
def test_backward_rows_have_the_heading_of_the_body(backward: bool) -> None:
    rows = swerving(3.0, 0.05)
    if backward:
        rows[:, 2] += math.pi
    (straight,) = straightened(problem((4.0, 2.0, 0.0)), rows, backward, None, True)
    away = np.abs(np.angle(np.exp(1j * (straight[:, 2] - (math.pi if backward else 0.0)))))
    assert away.max() < 0.4 and turning(straight) < turning(rows)


def corner(angle: float) -> Array:
    """2 m along x, a turn on the spot, and 2 m."""
    s = np.linspace(0.0, 2.0, 41)
    second = np.column_stack([3.0 + s * math.cos(angle), 2.0 + s * math.sin(angle), np.full(41, angle)])
    return np.vstack([np.column_stack([1.0 + s, np.full(41, 2.0), np.zeros(41)]), second])


def test_a_turn_on_the_spot_goes_where_a_bend_does() -> None:
    gentle, sharp = corner(0.3), corner(1.2)
    assert len(straightened(problem((*gentle[-1, :2], 0.0)), gentle, False, None, True)) == 1
    parts = straightened(problem((*sharp[-1, :2], 0.0)), sharp, False, None, True)
    assert len(parts) == 2
    assert parts[0][-1, :2] == pytest.approx(parts[1][0, :2])
    for part in parts:
        assert np.abs(np.diff(part[:, 2])).max(initial=0.0) <= MOST_BEND


def test_a_line_to_a_goal_at_which_the_last_turn_is_not_free_is_none() -> None:
    """Between two walls the body cannot turn to the goal's heading from that of a slanted line."""
    where = problem((4.0, 2.0, 0.0), 0.6)
    x = np.linspace(1.0, 4.0, 61)
    y = np.where(x < 2.5, 2.05 - 0.05 * (x - 1.0) / 1.5, 2.0)
    rows = np.column_stack([x, y, np.where(x < 2.5, math.atan2(-0.05, 1.5), 0.0)])
    for part in straightened(where, rows, False, 0.0, True):
        assert clearances(where, part).min() >= MARGIN
    assert abs(part[-1, 2]) < 0.1


@pytest.mark.parametrize("rows", [swerving(0.05, 0.0), swerving(0.1, 0.0), swerving(0.2, 0.01)])
def test_short_paths_stay(rows: Array) -> None:
    (straight,) = straightened(problem((*rows[-1, :2], 0.0)), rows, False, None, True)
    assert straight[-1, :2] == pytest.approx(rows[-1, :2]) and straight[0, :2] == pytest.approx(rows[0, :2])
