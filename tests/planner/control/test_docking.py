"""The law along the axis of a dock on a chassis that follows commands late, and the pose of the dock from sightings."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.control.docking import (
    ASIDE,
    STEEPEST,
    Funnel,
    FusedPose,
    along_axis,
    approach,
    has_arrived,
    turn_to_axis,
)
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.settings import NavigationSettings

SETTINGS = NavigationSettings()
PERIOD, LAG = 0.04, 0.1


def drive(at: tuple[float, float, float], direction: int, speed: float = 0.4) -> np.ndarray:
    """Rows x, y, yaw until it stops; a plant with a first-order lag."""
    pose, twist, rows = np.array(at), se2.STANDSTILL, [np.array(at)]
    while not has_arrived(pose, direction) and len(rows) < 1500:
        wanted = approach(pose, direction, speed, SETTINGS)
        share = PERIOD / LAG
        twist = twist.model_copy(
            update={
                "linear": twist.linear + share * (wanted.linear - twist.linear),
                "angular": twist.angular + share * (wanted.angular - twist.angular),
            }
        )
        pose = se2.advanced(pose, twist, PERIOD)
        rows.append(pose)
    return np.array(rows)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("aside", "turned"), [(0.0, 0.0), (0.1, 0.0), (-0.1, 0.2), (0.05, -0.25)])
def test_it_ends_on_the_axis_from_either_side(direction: int, aside: float, turned: float) -> None:
    rows = drive((-1.3 * direction, aside, turned), direction)
    x, y, yaw = rows[-1]
    assert abs(x) < 0.005 and abs(y) < 0.006 and abs(yaw) < 0.01
    assert np.abs(rows[:, 2]).max() < max(STEEPEST, abs(turned)) + 0.05
    entry = rows[np.abs(rows[:, 0]) < 0.7]
    assert np.abs(entry[:, 1]).max() < ASIDE


def test_beyond_the_goal_it_comes_back() -> None:
    rows = drive((0.05, 0.0, 0.01), 1)
    assert rows[:, 0].max() < 0.06 and abs(rows[-1][0]) < 0.012


def test_it_keeps_to_the_speed_and_slows_down_aside_of_the_axis() -> None:
    assert along_axis(np.zeros(3), 1, 3.0, 0.4, SETTINGS).linear == 0.4
    assert along_axis(np.zeros(3), -1, 3.0, 0.4, SETTINGS).linear == SETTINGS.control.max_backward_velocity
    assert along_axis(np.array([0.0, 0.08, -0.2]), 1, 3.0, 0.4, SETTINGS).linear == 0.15
    off = along_axis(np.array([0.0, 0.0, 1.0]), 1, 3.0, 0.4, SETTINGS)
    assert off.linear == 0.0 and off.angular == pytest.approx(-0.6), "first it turns"


def test_the_last_turn_is_slow_and_towards_the_axis() -> None:
    assert turn_to_axis(np.zeros(3)) == se2.STANDSTILL
    assert turn_to_axis(np.array([0.0, 0.0, 0.004])).angular == -0.015
    assert turn_to_axis(np.array([0.0, 0.0, -0.2])).angular == pytest.approx(0.3)


def test_a_funnel_narrows_to_its_entry() -> None:
    funnel = Funnel(entry=0.8)
    for direction in (1, -1):
        assert funnel.holds(np.array([-direction * 1.8, 0.18, 0.2]), direction)
        assert not funnel.holds(np.array([-direction * 1.0, 0.18, 0.2]), direction)
        assert funnel.holds(np.array([-direction * 0.2, 0.03, 0.1]), direction)
        assert not funnel.holds(np.array([-direction * 0.2, 0.03, 0.2]), direction)
    assert funnel.wider().holds(np.array([-0.2, 0.07, 0.2]), 1)


def test_sightings_are_averaged() -> None:
    random, fused = np.random.default_rng(1), FusedPose()
    assert fused.pose is None
    errors = []
    for _ in range(200):
        fused.update(np.array([2.0, 1.0, math.pi]) + random.normal(0, (0.008, 0.008, 0.008)))
        assert fused.pose is not None
        errors.append(se2.between(np.array([2.0, 1.0, math.pi]), fused.pose))
    spread = np.std(errors[20:], axis=0)
    assert (spread < 0.5 * 0.008).all(), "a low-pass with a weight of 1/4 leaves 0.38 of the noise"


def test_one_false_sighting_is_ignored_and_three_are_believed() -> None:
    fused = FusedPose()
    for _ in range(5):
        fused.update(np.array([2.0, 1.0, 0.0]))
    fused.update(np.array([2.1, 1.0, 0.0]))
    assert fused.pose is not None and fused.pose[0] == 2.0 and fused.sightings == 5
    fused.update(np.array([2.0, 1.0, 0.0]))
    for _ in range(3):
        fused.update(np.array([2.1, 1.0, 0.0]))
    assert fused.pose[0] == pytest.approx(2.1) and fused.sightings == 1
