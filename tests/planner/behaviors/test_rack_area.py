"""The points of a rack area and their order; the moves themselves are in tests/joined/test_rack_areas.py."""

from __future__ import annotations

import pytest

from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors import align_with_rack, to_unload_point
from rackhand.services.planner.behaviors.rack_area import (
    RackArea,
    align_for_request,
    area_of,
    is_enabled,
    unload_for_request,
)
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.map.overlays import MapOverlays, parse_overlays
from tests.planner.map.test_grid import feature

RING = [[0.0, 0.0], [4.0, 0.0], [4.0, 8.0], [0.0, 8.0]]
PLACES = {"low": [2.0, 1.0], "high": [2.0, 7.0], "middle": [2.0, 4.0], "outside": [6.0, 4.0]}


def point(name: str, **properties: object) -> dict:
    return feature("Point", PLACES[name], type="34", name=name, **properties)


def overlays(*features: dict, **area: object) -> MapOverlays:
    zone = feature("Polygon", [RING], regionType=17, name="north", **area) | {"id": "area"}
    return parse_overlays({"type": "FeatureCollection", "features": [zone, *features]})


def request(area: str = "area", **properties: object) -> MoveCreate:
    return MoveCreate(type="align_with_rack", rack_area_id=area, properties=properties)


ALL = tuple(point(name) for name in PLACES)


def test_its_points_are_those_inside_in_the_order_of_the_map() -> None:
    area = area_of(request(), overlays(*ALL))
    assert [p.name for p in area.points] == ["low", "high", "middle"] and area.patrol is None


@pytest.mark.parametrize(
    ("line", "order"),
    [([[1.0, 8.0], [1.0, 0.0]], ["high", "middle", "low"]), ([[1.0, 0.5], [1.0, 9.0]], ["low", "middle", "high"])],
)
def test_a_patrol_line_through_it_orders_them(line: list, order: list[str]) -> None:
    other = feature("LineString", [[20.0, 8.0], [20.0, 0.0]], lineType=4)
    area = area_of(request(), overlays(*ALL, other, feature("LineString", line, lineType="4")))
    assert [p.name for p in area.points] == order


def test_an_id_that_is_no_rack_area_is_507_and_names_those_there_are() -> None:
    with pytest.raises(MoveFailed, match="known: area") as failed:
        area_of(request("low"), overlays(*ALL))
    assert failed.value.reason is Reason.INVALID_RACK_AREA_ID


@pytest.mark.parametrize("features", [(), (point("outside"),)])
def test_an_area_without_points_is_508(features: tuple[dict, ...]) -> None:
    with pytest.raises(MoveFailed) as failed:
        area_of(request(), overlays(*features))
    assert failed.value.reason is Reason.INVALID_RACK_AREA


@pytest.mark.parametrize(
    ("levels", "enabled", "layer", "expected"),
    [
        ([], None, 0, True),
        ([], None, 1, False),
        ([{"id": 7}, {"id": 9}], None, 1, True),
        ([{"id": 7}, {"id": 9}], None, 2, False),
        ([{"id": 7}, {"id": 9}], [9], 1, True),
        ([{"id": 7}, {"id": 9}], [7], 1, False),
        ([{"id": 7}, {"id": 9}], [], 1, True),
        ([{"id": 7}, {"id": 9}], None, -1, False),
        ([{"id": 7}, {"id": 9}], None, True, False),
        ("broken", "broken", 0, True),
    ],
)
def test_levels(levels: object, enabled: object, layer: object, expected: bool) -> None:
    stored = overlays(point("low", **({} if enabled is None else {"enabledLevels": enabled})), rackLevels=levels)
    assert is_enabled(stored.points[0], stored.zones[0], layer) is expected


def test_points_without_the_wanted_level_are_left_out() -> None:
    stored = overlays(point("low", enabledLevels=[1]), point("high"), rackLevels=[{"id": 0}, {"id": 1}])
    assert [p.name for p in area_of(request(rack_layer=0), stored).points] == ["high"]
    with pytest.raises(MoveFailed, match="with level 5"):
        area_of(request(rack_layer=5), stored)


def test_a_request_with_an_area_is_for_it_and_one_without_for_its_point() -> None:
    at_point = MoveCreate(type="align_with_rack", target_x=1.0, target_y=1.0)
    assert isinstance(align_for_request(request()), RackArea) and isinstance(unload_for_request(request()), RackArea)
    assert type(align_for_request(at_point)) is type(align_with_rack.for_request(at_point))
    assert type(unload_for_request(at_point)) is to_unload_point.ToUnloadPoint
