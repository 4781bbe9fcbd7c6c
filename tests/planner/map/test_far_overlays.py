"""Overlays with coordinates far off the map: clipped to it, whatever their size."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rackhand.schemas.maps import LineType, RegionType
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.map.grid import clip
from tests.planner.map.test_grid import feature, load

FAR = (1e3, 1e7, 1e150, 1e300, 1.7e308)
G = Geometry(-2.0, -1.0, 0.1, 40, 60)


@pytest.mark.parametrize("far", FAR)
def test_a_wall_that_leaves_the_map_is_drawn_as_far_as_its_edge(far: float) -> None:
    near = load(feature("LineString", [[0, 1.5], [4, 1.5]], lineType=LineType.VIRTUAL_WALL)).blocked
    for line in ([[0, 1.5], [far, 1.5]], [[-far, 1.5], [far, 1.5]], [[far, 1.5], [-far, 1.5]]):
        long = load(feature("LineString", line, lineType=LineType.VIRTUAL_WALL)).blocked
        np.testing.assert_array_equal(long, near)


@pytest.mark.parametrize("far", FAR)
def test_walls_that_pass_by_and_zones_beyond_block_nothing(far: float) -> None:
    line = feature("LineString", [[far, 5.0], [far, 9.0], [-far, 9.0]], lineType=LineType.VIRTUAL_WALL)
    ring = [[far, far], [far * 0.99, far], [far, far / 2]]
    zone = feature("Polygon", [ring], regionType=RegionType.NO_GO)
    np.testing.assert_array_equal(load(line, zone).blocked, load().blocked)


@pytest.mark.parametrize("far", FAR)
def test_a_zone_larger_than_the_map_covers_it(far: float) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ring = [[-far, -far], [far, -far], [far, far], [-far, far]]
        assert load(feature("Polygon", [ring], regionType=RegionType.NO_GO)).blocked.all()
        slow = load(feature("Polygon", [ring], regionType=RegionType.SLOW)).speed_limit
    assert (slow == np.float32(0.4)).all()


@given(st.lists(st.floats(-20, 20), min_size=4, max_size=4))
@settings(max_examples=200)
def test_what_is_clipped_lies_on_the_line_and_on_the_map(numbers: list[float]) -> None:
    start, end = np.array(numbers[:2]), np.array(numbers[2:])
    inside = [
        start + t * (end - start) for t in np.linspace(0, 1, 101) if G.contains(*(start + t * (end - start)).tolist())
    ]
    clipped = clip(G, start, end)
    assert clipped is not None or not inside
    if clipped is not None:
        for point in clipped:
            assert -2.11 <= point[0] <= 4.11 and -1.11 <= point[1] <= 3.11
            length = max(math.dist(start, end), 1e-9)
            cross = (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])
            assert abs(cross) / length < 1e-6
        low = np.minimum(*clipped) - 1e-9
        high = np.maximum(*clipped) + 1e-9
        assert all((low <= point).all() and (point <= high).all() for point in inside)
