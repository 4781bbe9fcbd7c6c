"""Racks that are measured on request, and those that are reported as seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from rackhand.schemas import topics
from rackhand.schemas.chassis import DetectRacks
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.perception.seen_scan import SeenScan
from rackhand.services.planner.rack_reports import leg_size_of, rack_ahead
from tests.planner.fakes import Cell
from tests.planner.racks import LARGE, SENSOR, STANDARD, legs, look

HERE = np.array([6.0, 6.0, 0.0])
UNKNOWN = RackSpec(width=0.7, depth=0.5)  # of no kind that is set


def seen(*racks: tuple[RackSpec, Sequence[float]], pose: Any = HERE) -> SeenScan:
    things = [leg for spec, at in racks for leg in legs(spec, at)]
    return SeenScan(7, look(things, pose=pose), np.array(pose), np.zeros(3), SENSOR)


@pytest.mark.parametrize("spec", [STANDARD, LARGE, UNKNOWN])
@pytest.mark.parametrize("yaw", [0.0, 0.1, -0.2])
def test_a_rack_of_any_size_is_measured_with_its_depth_ahead(spec: RackSpec, yaw: float) -> None:
    found = rack_ahead(seen((spec, (8.2, 6.1, yaw))), spec.leg_size, front=0.375)
    assert found.detected and found.pose is not None and found.staging is not None
    assert (found.width, found.depth) == pytest.approx((spec.width, spec.depth), abs=0.02)
    assert (found.pose.x, found.pose.y) == pytest.approx((8.2, 6.1), abs=0.015)
    assert found.pose.yaw == pytest.approx(yaw, abs=0.03)
    assert len(found.legs) == 4
    back = se2.between(np.array([found.pose.x, found.pose.y, found.pose.yaw]), se2.pose(found.staging))
    assert back == pytest.approx([-0.5 * spec.depth - 0.5 - 0.375, 0.0, 0.0], abs=0.02)


def test_the_nearest_in_front_counts_and_none_behind_or_far_away() -> None:
    near, far, behind = (STANDARD, (8.0, 6.0, 0.0)), (LARGE, (9.8, 6.0, 0.0)), (UNKNOWN, (4.6, 6.0, 0.0))
    assert rack_ahead(seen(near, far, behind), 0.03, 0.375).width == pytest.approx(STANDARD.width, abs=0.02)
    assert rack_ahead(seen(behind), 0.03, 0.375).detected is False
    assert rack_ahead(seen((STANDARD, (10.8, 6.0, 0.0))), 0.03, 0.375).detected is False


def test_it_is_placed_in_the_map_from_where_the_chassis_is() -> None:
    pose = (6.0, 6.0, 1.2)
    at = se2.compose(np.array(pose), np.array([2.0, 0.2, 0.1]))
    found = rack_ahead(seen((STANDARD, at), pose=pose), 0.03, 0.375)
    assert found.pose is not None
    assert (found.pose.x, found.pose.y, found.pose.yaw) == pytest.approx(tuple(at), abs=0.02)


def test_the_leg_size_is_that_of_the_first_kind() -> None:
    assert leg_size_of((LARGE, STANDARD)) == 0.04 and leg_size_of(()) == 0.03


def test_a_search_runs_twice_a_second_from_its_start_to_its_end_while_no_move_runs(
    make_cell: Callable[..., Cell],
) -> None:
    cell = make_cell()
    cell.tick(25)
    assert cell.heard(topics.DETECTED_RACK) == []
    cell.ask(DetectRacks(enable=True))
    cell.tick(50)  # 2 s
    searches = cell.heard(topics.DETECTED_RACK)
    assert 3 <= len(searches) <= 5 and not any(search.detected for search in searches)
    move = cell.create()
    cell.tick(50)
    assert len(cell.heard(topics.DETECTED_RACK)) <= len(searches) + 1
    cell.cancel(move.id)
    cell.ask(DetectRacks(enable=False))
    before = len(cell.heard(topics.DETECTED_RACK))
    cell.tick(50)
    assert len(cell.heard(topics.DETECTED_RACK)) == before
