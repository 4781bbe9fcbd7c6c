"""Names and clearances of what keeps a footprint from a place."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.perception import things
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import BODY, Hall, box

FOOTPRINT = Footprint.of(BODY)
HALF = float(np.abs(BODY[:, 0]).max())
ZONE = {
    "type": "Feature",
    "id": "zone",
    "geometry": {"type": "Polygon", "coordinates": [[[6, 1], [8, 1], [8, 3], [6, 3], [6, 1]]]},
    "properties": {"regionType": 1, "name": "aisle"},
}
LINE = {
    "type": "Feature",
    "id": "line",
    "geometry": {"type": "LineString", "coordinates": [[1, 6], [4, 6]]},
    "properties": {"lineType": 2},
}


@pytest.fixture(scope="module")
def costmap() -> LocalCostmap:
    """A hall of 10 m by 8 m with a box at (5, 4), 1 m by 2 m, a no-go zone and a virtual wall."""
    settings = NavigationSettings()
    hall = Hall(10, 8, [box(5, 4, 1, 2)], overlays=[ZONE, LINE])
    return LocalCostmap(load_map(hall.map(), settings.slow_zone_velocity), settings)


@pytest.mark.parametrize(
    ("x", "y", "expected"),
    [
        (5.0, 3.05, ("mapped obstacle", "")),
        (7.0, 2.0, ("no-go zone", "aisle")),
        (2.0, 6.0, ("virtual wall", "line")),
        (50.0, 2.0, ("edge of the map", "")),
        (2.0, 2.0, None),
    ],
)
def test_what_the_map_has_at_a_point(
    costmap: LocalCostmap, x: float, y: float, expected: tuple[str, str] | None
) -> None:
    assert things.mapped_kind_at(costmap.static, x, y) == expected


def test_what_is_in_a_cell_that_the_map_calls_free_was_seen(costmap: LocalCostmap) -> None:
    thing = things.thing_at(costmap, 2.0, 2.0)
    assert (thing.role, thing.kind, thing.x, thing.y) == ("blocks", "observed obstacle", 2.0, 2.0)


def test_the_clearance_to_the_nearest_mapped_thing_is_measured_from_the_footprint(costmap: LocalCostmap) -> None:
    pose = np.array([4.5 - HALF - 0.2, 4.0, 0.0])  # its front 0.2 m before the box
    thing = things.mapped_at(costmap, FOOTPRINT, pose, needed=0.3)
    assert thing is not None
    assert (thing.kind, thing.needed) == ("mapped obstacle", 0.3)
    assert thing.clearance == pytest.approx(0.2, abs=0.06)
    assert thing.x == pytest.approx(4.5, abs=0.06)
    far = np.array([2.5, 3.0, 0.0])
    assert things.mapped_at(costmap, FOOTPRINT, far) is None


def test_the_first_thing_on_a_path_is_named(costmap: LocalCostmap) -> None:
    costmap.refresh(np.array([2.5, 4.0, 0.0]))
    path = np.column_stack([np.arange(2.5, 5.0, 0.1), np.full(25, 4.0), np.zeros(25)])
    thing = things.on_path(costmap, FOOTPRINT, path, needed=0.05)
    assert thing is not None and thing.kind == "mapped obstacle"
    assert thing.clearance is not None and thing.clearance < 0.05
    assert things.on_path(costmap, FOOTPRINT, path[:5], needed=0.05) is None


def test_what_a_turn_on_the_spot_would_hit_is_named(costmap: LocalCostmap) -> None:
    sideways = np.array([4.5 - FOOTPRINT.circumscribed + 0.05, 4.0, math.pi / 2])
    costmap.refresh(sideways)
    thing = things.beside_turn(costmap, FOOTPRINT, sideways)
    assert thing is not None
    assert thing.clearance == pytest.approx(-0.05, abs=0.06)
    free = np.array([2.5, 4.0, 0.0])
    costmap.refresh(free)
    assert things.beside_turn(costmap, FOOTPRINT, free) is None
