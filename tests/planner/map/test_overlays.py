"""GeoJSON to typed features, and what is wrong with it."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.schemas.maps import LineType, PointType, RegionType
from rackhand.services.planner.map.overlays import MapOverlays, OverlayError, Zone, inside, parse_overlays
from tests.planner.map.test_grid import feature

WAREHOUSE = Path(__file__).parents[3] / "worlds" / "warehouse" / "overlays.geojson"
SQUARE = [[0, 0], [2, 0], [2, 2], [0, 2]]


def parse(*features: dict, **collection: object) -> MapOverlays:
    return parse_overlays({"type": "FeatureCollection", "features": list(features), **collection})


def test_warehouse() -> None:
    overlays = parse_overlays(json.loads(WAREHOUSE.read_text()))
    assert [p.name for p in overlays.points_of(PointType.RACK)] == [f"s{k}" for k in range(1, 9)] + ["p1", "p2", "p3"]
    (charger,) = overlays.points_of(PointType.CHARGER)
    assert (charger.x, charger.y, charger.yaw) == (0.72, 1.5, 0.0)
    docking = overlays.point(charger.docking_point_id or "")
    assert docking is not None and docking.type is PointType.DOCKING and docking.docking_point_id == charger.id
    assert docking.yaw == pytest.approx(math.pi)
    (storage, _) = overlays.zones_of(RegionType.RACK_ZONE)
    inside_it = [p.name for p in overlays.points_of(PointType.RACK) if storage.contains(p.x, p.y)]
    assert inside_it == [f"s{k}" for k in range(1, 9)]
    assert overlays.zone(storage.id) is storage
    (wall,) = overlays.lines_of(LineType.VIRTUAL_WALL)
    assert wall.points.tolist() == [[12.4, 9.0], [14.6, 9.0]]
    assert [z.name for z in overlays.zones_of(RegionType.NO_GO, RegionType.SLOW)] == ["pick_station", "people_cross"]


@pytest.mark.parametrize(
    ("yaw", "radians"), [(90, math.pi / 2), ("-90", -math.pi / 2), (0.5, math.radians(0.5)), (None, None), ("", None)]
)
def test_yaw_is_degrees_as_number_or_string(yaw: object, radians: float | None) -> None:
    (point,) = parse(feature("Point", [1, 2], type="34", yaw=yaw)).points
    assert point.yaw == (None if radians is None else pytest.approx(radians))
    assert point.properties["yaw"] == yaw


@pytest.mark.parametrize("code", [17, "17", 17.0])
def test_codes_are_numbers_or_strings(code: object) -> None:
    (zone,) = parse(feature("Polygon", [SQUARE], regionType=code, name="storage")).zones
    assert (zone.type, zone.name) == (RegionType.RACK_ZONE, "storage")


def test_unknown_codes_and_none_are_left_out() -> None:
    overlays = parse(
        feature("Point", [1, 1], type=24),
        feature("Point", [1, 1]),
        feature("LineString", [[0, 0], [1, 1]], lineType="99"),
        feature("Polygon", [SQUARE], regionType=0),
        feature("Polygon", [SQUARE], type=9),
    )
    assert overlays == MapOverlays()


def test_properties_of_the_collection_are_kept() -> None:
    assert parse(properties={"defaultRackWidth": 0.8}).properties == {"defaultRackWidth": 0.8}


def test_rings_are_closed_and_inner_ones_are_holes() -> None:
    hole = [[0.5, 0.5], [1.5, 0.5], [1.5, 1.5], [0.5, 1.5]]
    for ring in (SQUARE, [*SQUARE, SQUARE[0]]):
        (zone,) = parse(feature("Polygon", [ring, hole], regionType=1)).zones
        assert [len(r) for r in zone.rings] == [5, 5]
        assert zone.contains(0.2, 1.0) and not zone.contains(1.0, 1.0) and not zone.contains(2.1, 1.0)


def test_nearest_point_of_a_type_within_reach() -> None:
    points = parse(
        feature("Point", [1, 0], type=9, name="near"),
        feature("Point", [5, 0], type=9, name="far"),
        feature("Point", [0, 0], type=34),
    )
    found = points.nearest_point(PointType.CHARGER, 0.0, 0.0)
    assert found is not None and found.name == "near"
    assert points.nearest_point(PointType.CHARGER, 0.0, 0.0, within=0.5) is None
    assert points.nearest_point(PointType.STANDBY, 0.0, 0.0) is None


@pytest.mark.parametrize(
    ("bad", "text"),
    [
        (
            feature("Point", [1, 1], type="34", yaw="north", name="s1"),
            "overlays.features[1].properties.yaw: 'north', want degrees such as 90 or '90' (feature 's1')",
        ),
        (
            feature("Point", [1, 1], type="34", yaw=math.inf),
            "overlays.features[1].properties.yaw: inf, want degrees such as 90 or '90'",
        ),
        (
            feature("Point", [1, 1], type="rack"),
            "overlays.features[1].properties.type: 'rack', want a type code such as 2 or '2'",
        ),
        (
            {**feature("LineString", [[1, 1]], lineType=2), "id": "5f0c"},
            "overlays.features[1].geometry.coordinates: 1 positions, want at least 2 (feature '5f0c')",
        ),
        (
            feature("Polygon", [[[1, 1], [2, 2], [1, 1]]], regionType=5),
            "overlays.features[1].geometry.coordinates[0]: 2 different corners, want at least 3",
        ),
        (
            feature("Point", [1, "2"], type=34),
            "overlays.features[1].geometry.coordinates: [1, '2'], want x, y in metres",
        ),
    ],
)
def test_a_broken_feature_is_named_with_field_value_and_what_was_expected(bad: dict, text: str) -> None:
    with pytest.raises(OverlayError) as error:
        parse(feature("Point", [1, 1], type=9), bad)
    assert str(error.value) == text


@given(
    st.lists(st.floats(0.5, 3.0), min_size=3, max_size=9),
    st.tuples(st.floats(-4, 4), st.floats(-4, 4)),
)
def test_inside_agrees_with_the_angle_sum_of_a_star_shaped_ring(radii: list[float], point: tuple[float, float]) -> None:
    angles = np.arange(len(radii)) * 2 * math.pi / len(radii)
    ring = np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
    ring = np.vstack([ring, ring[:1]])
    seen = np.unwrap(np.arctan2(ring[:, 1] - point[1], ring[:, 0] - point[0]))
    turns = (seen[-1] - seen[0]) / (2 * math.pi)
    sides, rel = np.diff(ring, axis=0), np.asarray(point) - ring[:-1]
    t = np.clip(np.sum(rel * sides, axis=1) / np.sum(sides**2, axis=1), 0, 1)
    if np.hypot(*(rel - t[:, None] * sides).T).min() < 1e-6:
        return  # on the ring
    found = inside((ring,), np.array([point[0]]), np.array([point[1]]))[0, 0]
    assert found == (round(abs(turns)) == 1)
    assert Zone("", "", {}, RegionType.SLOW, (ring,)).contains(*point) == found


PROPERTIES = st.dictionaries(
    st.sampled_from(["type", "lineType", "regionType", "yaw", "name"]),
    st.none() | st.text(max_size=4) | st.floats() | st.integers() | st.lists(st.integers(), max_size=1),
)
COORDINATES = st.recursive(st.floats() | st.integers() | st.text(max_size=2), lambda s: st.lists(s, max_size=4))


@given(st.sampled_from(["Point", "LineString", "Polygon", "Circle"]), COORDINATES, PROPERTIES)
def test_anything_is_parsed_or_refused(kind: str, coordinates: object, properties: dict) -> None:
    try:
        overlays = parse(
            {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}
        )
    except OverlayError as error:
        assert error.where.startswith("overlays.features[0]")
    else:
        assert len(overlays.points + overlays.lines + overlays.zones) <= 1
