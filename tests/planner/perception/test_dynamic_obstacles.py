from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import pytest

from rackhand.services.planner.perception.dynamic_obstacles import DynamicObstacleTracker

PERIOD = 0.08
SENSOR = np.zeros(2)


@dataclass
class Seen:
    """What the tracker asks of ``ObservedObstacles``: hits, all unmapped, and where rays passed."""

    points: np.ndarray
    is_fresh: bool
    left_free: bool = False
    is_steady: bool = False
    unmapped: np.ndarray = field(init=False)
    fresh: np.ndarray = field(init=False)
    steady: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.unmapped = np.ones(len(self.points), dtype=bool)
        self.fresh = np.full(len(self.points), self.is_fresh)
        self.steady = np.full(len(self.points), self.is_steady)

    def is_seen_free(self, _: np.ndarray) -> bool:
        return self.left_free


def front(x: float, y: float) -> np.ndarray:
    """Hits on something 0.4 m wide that faces the sensor at the origin."""
    return np.column_stack([np.full(5, x), y + np.linspace(-0.2, 0.2, 5)])


def follow(tracker: DynamicObstacleTracker, speed: float, scans: int, fresh: bool) -> np.ndarray:
    for k in range(scans):
        at = 4.0 - speed * PERIOD * k
        velocities = tracker.update(Seen(front(at, 0.0), fresh, fresh), SENSOR, int(k * PERIOD * 1e9))  # type: ignore[arg-type]
    return velocities


def test_something_that_comes_is_moving_with_its_velocity() -> None:
    tracker = DynamicObstacleTracker()
    velocities = follow(tracker, 1.0, 25, fresh=True)
    ((x, y, vx, vy, radius),) = tracker.rows()
    assert (vx, vy) == pytest.approx((-1.0, 0.0), abs=0.1)
    assert (x, y) == pytest.approx((4.0 - 24 * PERIOD + 0.12, 0.0), abs=0.1)
    assert 0.2 < radius < 0.5
    assert velocities == pytest.approx(np.tile([vx, vy], (5, 1)))
    assert tracker.moved_near(np.array([x, y]), 0.1, int(2e9))
    assert not tracker.moved_near(np.array([x, y + 3.0]), 0.1, int(2e9))
    assert not tracker.moved_near(np.array([x, y]), 0.1, int(99e9))


def test_what_only_seems_to_move_is_not_moving_without_witnesses() -> None:
    tracker = DynamicObstacleTracker()
    follow(tracker, 1.0, 25, fresh=False)
    assert tracker.rows().shape == (0, 5)


def test_something_at_rest_is_not_moving() -> None:
    tracker = DynamicObstacleTracker()
    assert not follow(tracker, 0.0, 25, fresh=True).any() and tracker.moving == []


def test_it_is_lost_when_it_is_not_seen_for_some_scans() -> None:
    tracker = DynamicObstacleTracker()
    follow(tracker, 1.0, 25, fresh=True)
    for k in range(25, 40):
        tracker.update(Seen(np.empty((0, 2)), False), SENSOR, int(k * PERIOD * 1e9))  # type: ignore[arg-type]
    assert tracker.moving == []


def test_two_things_apart_are_two_and_a_long_wall_is_none() -> None:
    tracker = DynamicObstacleTracker()
    wall = np.column_stack([np.full(40, 5.0), np.linspace(-4.0, 4.0, 40)])
    for k in range(25):
        step = 0.6 * PERIOD * k
        points = np.vstack([front(3.0 - step, -1.5), wall, front(4.0 - step, 1.5)])
        tracker.update(Seen(points, True, True), SENSOR, int(k * PERIOD * 1e9))  # type: ignore[arg-type]
    assert sorted(row[1] for row in tracker.rows()) == pytest.approx([-1.5, 1.5], abs=0.15)
    assert math.hypot(*tracker.rows()[0][2:4]) == pytest.approx(0.6, abs=0.1)


def test_the_edge_of_something_that_stands_there_is_not_moving() -> None:
    tracker = DynamicObstacleTracker()
    for k in range(25):
        seen = Seen(front(4.0 - PERIOD * k, 0.0), is_fresh=True, left_free=True, is_steady=True)
        velocities = tracker.update(seen, SENSOR, int(k * PERIOD * 1e9))  # type: ignore[arg-type]
        assert not len(tracker.rows()) and not velocities.any()
