"""Plans on large maps: as good as on the whole map, in a part of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.planning import windows
from rackhand.services.planner.planning.plan import GlobalPlanner, NoPathFound, Plan, Target
from rackhand.services.planner.planning.windows import LargePlanner, about, part, way_out
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import BODY

FOOTPRINT = Footprint.of(BODY)
NONE = np.empty(0, dtype=np.int64)
S = NavigationSettings()


def hall(metres: float, resolution: float = 0.1, shelves: int = 0, seed: int = 1) -> tuple[Geometry, np.ndarray]:
    """A walled square with its lower left corner at 0, 0, and shelves of up to 5 x 3 m away from its corners."""
    side = round(metres / resolution)
    blocked = np.zeros((side, side), dtype=np.bool_)
    blocked[[0, -1]] = blocked[:, [0, -1]] = True
    random = np.random.default_rng(seed)
    for _ in range(shelves):
        x, y = random.uniform(6.0, metres - 12.0, 2)
        width, depth = random.uniform(0.5, 5.0), random.uniform(0.5, 3.0)
        rows = slice(int(y / resolution), int((y + depth) / resolution))
        blocked[rows, int(x / resolution) : int((x + width) / resolution)] = True
    return Geometry(0.0, 0.0, resolution, side, side), blocked


def run(search) -> Plan:  # type: ignore[no-untyped-def]
    while True:
        try:
            next(search)
        except StopIteration as found:
            return found.value


def plan(geometry: Geometry, blocked: np.ndarray, start: tuple[float, float], goal: tuple[float, float]) -> Plan:
    planner = LargePlanner(geometry, blocked, NONE, FOOTPRINT, S)
    return run(planner.search(np.array([*start, 0.0]), Target(*goal, None)))


@pytest.mark.parametrize("seed", range(6))
def test_a_plan_in_a_part_is_as_long_as_one_on_the_whole_map(seed: int) -> None:
    geometry, blocked = hall(90.0, shelves=120, seed=seed)
    random = np.random.default_rng(seed)
    start, goal = (2.0, 2.0), (float(random.uniform(2, 4)), float(random.uniform(8, 80)))
    whole = GlobalPlanner(geometry, FOOTPRINT, S).plan(np.array([*start, 0.0]), Target(*goal, None), blocked)
    found = plan(geometry, blocked, start, goal)
    assert found.length == pytest.approx(whole.length, rel=0.01)
    assert found.start_cost == pytest.approx(whole.start_cost, rel=1e-4)


def test_only_a_part_is_searched_where_that_is_enough() -> None:
    geometry, blocked = hall(90.0)
    found = plan(geometry, blocked, (3.0, 3.0), (6.0, 3.0))
    assert found.cost.size < 0.1 * blocked.size
    assert np.allclose(found.segments[-1].points[-1, :2], (6.0, 3.0))


def test_a_way_round_that_leaves_every_part_is_found() -> None:
    geometry, blocked = hall(90.0)
    blocked[:-30, 450] = True  # a wall of 87 m beside start and goal
    found = plan(geometry, blocked, (43.0, 3.0), (47.0, 3.0))
    assert found.length > 160.0
    blocked[:, 450] = True
    with pytest.raises(NoPathFound) as none:
        plan(geometry, blocked, (43.0, 3.0), (47.0, 3.0))
    assert none.value.kind == "disconnected"


def test_observed_cells_are_avoided() -> None:
    geometry, blocked = hall(90.0)
    rows, columns = np.meshgrid(np.arange(20, 45), [45, 46])
    observed = (rows * geometry.columns + columns).reshape(-1)
    planner = LargePlanner(geometry, blocked, observed, FOOTPRINT, S)
    points = np.vstack(
        [s.points for s in run(planner.search(np.array([3.0, 3.0, 0.0]), Target(6.0, 3.0, None))).segments]
    )
    assert not ((points[:, 1] > 2.0) & (points[:, 1] < 4.5) & (np.abs(points[:, 0] - 4.6) < 0.2)).any()


def test_the_way_out_of_a_part_counts_only_its_open_sides() -> None:
    geometry, _ = hall(90.0)
    target = Target(10.0, 4.0, None)
    window = about(geometry, np.array([5.0, 3.0, 0.0]), target, 8.0)
    inner = part(geometry, window)
    assert (inner.x, inner.y) == (0.0, 0.0) and inner.columns * 0.1 == pytest.approx(18.1, abs=0.11)
    assert way_out(geometry, window, np.array([5.0, 3.0, 0.0]), target) == pytest.approx(17.0, abs=0.3)
    whole = slice(0, geometry.rows), slice(0, geometry.columns)
    assert math.isinf(way_out(geometry, whole, np.array([5.0, 3.0, 0.0]), target))


def test_a_map_too_large_to_be_searched_at_once_is_planned_piece_by_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(windows, "LARGEST", 700_000)
    monkeypatch.setattr(windows, "COARSE_CELLS", 40_000)
    geometry, blocked = hall(150.0, shelves=300)
    here, goal = np.array([2.0, 2.0, 0.0]), Target(147.0, 147.0, None)
    planner, pieces = LargePlanner(geometry, blocked, NONE, FOOTPRINT, S), 0
    while (found := run(planner.search(here, goal))).open_from is not None:
        planned = found.segments[: found.open_from]
        assert np.allclose(found.segments[-1].points[-1, :2], (147.0, 147.0))
        assert sum(segment.length for segment in planned) > 20.0
        here, pieces = planned[-1].points[-1], pieces + 1
        assert pieces < 12
    assert pieces >= 2
