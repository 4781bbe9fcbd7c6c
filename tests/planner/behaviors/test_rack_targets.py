"""Which rack point a request means, and which levels it has."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors import to_unload_point
from rackhand.services.planner.behaviors.align_with_rack import target_of
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.map.overlays import MapOverlays, parse_overlays


def feature(kind: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    geometry = {"type": kind, "coordinates": coordinates}
    return {"type": "Feature", "id": properties["name"], "geometry": geometry, "properties": properties}


def overlays(*features: dict[str, Any]) -> MapOverlays:
    return parse_overlays({"type": "FeatureCollection", "features": list(features)})


S1 = feature("Point", [1.0, 2.0], type="34", name="s1", yaw="90")
P1 = feature("Point", [9.0, 2.0], type=34, name="p1")
SHELF = feature("Polygon", [[[0, 0], [3, 0], [3, 3], [0, 3]]], regionType=17, name="storage",
                rackLevels=[{"id": 0, "height": 0.0}, {"id": 1, "height": 1.0}])  # fmt: skip
MAP = overlays(S1, P1, SHELF, feature("Point", [5.0, 5.0], type="10", name="standby"))


def request(x: float | None, y: float | None, ori: float | None = None, **properties: Any) -> MoveCreate:
    return MoveCreate(type="align_with_rack", target_x=x, target_y=y, target_ori=ori, properties=properties)


def test_the_nearest_rack_point_is_meant_and_its_heading_unless_another_is_requested() -> None:
    target = target_of(request(1.1, 2.2), MAP, 0.3)
    assert target.pose.tolist() == pytest.approx([1.0, 2.0, math.pi / 2])
    assert str(target) == "rack point 's1' (1.00, 2.00)"
    assert target_of(request(1.0, 2.0, -1.0), MAP, 0.3).yaw == -1.0
    assert target_of(request(9.0, 2.0), MAP, 0.3).yaw == 0.0
    assert target_of(request(1.0, 2.0, 0.0), MAP, 0.3).yaw == 0.0


@pytest.mark.parametrize(("side", "degrees"), [("front", 90), (None, 90), ("any", 90), ("back", -90)])
def test_a_point_is_docked_to_from_its_side(side: str | None, degrees: float) -> None:
    """Without a requested heading; the rack that is put down there can be fetched from the same side."""
    point = feature("Point", [1.0, 2.0], type="34", name="s1", yaw="90", dockViaDirection=side)
    wanted, found = request(1.0, 2.0), overlays(point)
    assert target_of(wanted, found, 0.3).yaw == pytest.approx(math.radians(degrees))
    assert to_unload_point.target_of(wanted, found, 0.3).yaw == pytest.approx(math.radians(degrees))
    assert target_of(request(1.0, 2.0, 0.3), found, 0.3).yaw == 0.3


@pytest.mark.parametrize(
    ("wanted", "found", "text"),
    [
        (request(1.4, 2.0), MAP, "the nearest is 's1' at (1.00, 2.00), 0.40 m away, want at most 0.30 m"),
        (request(1.0, 2.0), overlays(), "the map has no rack points"),
        (request(None, None, 1.0), MAP, "needs target_x and target_y"),
        (
            request(1.0, 2.0, rack_layer=2),
            MAP,
            "point 's1', in rack area 'storage', has 2 levels: want 0 to 1",
        ),
        (request(1.0, 2.0, rack_layer=-1), MAP, "want 0 to 1"),
        (request(1.0, 2.0, rack_layer="top"), MAP, "properties.rack_layer is 'top'"),
        (request(1.0, 2.0, rack_layer=True), MAP, "properties.rack_layer is True"),
        (request(9.0, 2.0, rack_layer=1), MAP, "outside of rack areas, has 1 levels: want 0 to 0"),
    ],
)
def test_what_is_no_rack_point_or_no_level_is_500(wanted: MoveCreate, found: MapOverlays, text: str) -> None:
    with pytest.raises(MoveFailed) as failed:
        target_of(wanted, found, 0.3)
    assert failed.value.reason == Reason.INVALID_RACK_DETECTION_POS
    assert text in failed.value.text


def test_a_level_of_the_area_is_taken() -> None:
    assert target_of(request(1.0, 2.0, rack_layer=1), MAP, 0.3).layer == 1
    assert target_of(request(9.0, 2.0, rack_layer=0), MAP, 0.3).layer == 0
    assert target_of(request(9.0, 2.0), MAP, 0.3).layer is None
