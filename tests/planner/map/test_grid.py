from __future__ import annotations

import numpy as np
import pytest

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.map.grid import load_map
from tests.planner.plant import Hall

SLOW = 0.4


def feature(kind: str, coordinates: list, **properties: object) -> dict:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}, "properties": properties}


def load(*features: dict):
    return load_map(Hall(4, 3, overlays=list(features)).map(), SLOW)


def test_walls_are_occupied_and_row_0_is_the_bottom() -> None:
    hall = Hall(4, 3)
    hall.mapped = [np.array([(0, 0), (4, 0), (4, 0.5), (0, 0.5)])]
    static = load_map(hall.map(), SLOW)
    assert static.occupied[2].all()
    assert not static.occupied[12:].any()
    assert static.blocked[static.geometry.cell(1.0, 0.2)]
    assert not static.blocked[static.geometry.cell(1.0, 2.8)]


def test_unknown_is_no_ground_but_not_built() -> None:
    import io

    from PIL import Image

    grey = np.full((60, 80), 254, dtype=np.uint8)
    grey[:, 40:] = 205
    stream = io.BytesIO()
    Image.fromarray(grey).save(stream, "PNG")
    static = load_map(Hall(4, 3).map().model_copy(update={"png": stream.getvalue()}), SLOW)
    assert static.blocked[30, 50] and not static.occupied[30, 50]
    assert not static.blocked[30, 30]


@pytest.mark.parametrize("code", [2, "2"])
def test_virtual_wall_blocks_but_is_not_seen(code: int | str) -> None:
    static = load(feature("LineString", [[1, 1], [3, 2]], lineType=code))
    on_the_line = static.geometry.cell(2.0, 1.5)
    assert static.blocked[on_the_line] and not static.occupied[on_the_line]


@pytest.mark.parametrize("code", [1, "1"])
@pytest.mark.parametrize("close", [True, False])
def test_no_go_region_closed_or_not(code: int | str, close: bool) -> None:
    ring = [[1, 1], [2, 1], [2, 2], [1, 2]]
    static = load(feature("Polygon", [ring + ring[:1] * close], regionType=code))
    assert static.blocked[static.geometry.cell(1.5, 1.5)]
    assert not static.blocked[static.geometry.cell(2.5, 1.5)]


def test_hole_in_a_no_go_region_is_ground() -> None:
    outer, inner = [[0.5, 0.5], [3.5, 0.5], [3.5, 2.5], [0.5, 2.5]], [[1.5, 1], [2.5, 1], [2.5, 2], [1.5, 2]]
    static = load(feature("Polygon", [outer, inner], regionType=1))
    assert static.blocked[static.geometry.cell(1.0, 1.5)]
    assert not static.blocked[static.geometry.cell(2.0, 1.5)]


def test_slow_region_limits_speed_only_inside() -> None:
    static = load(feature("Polygon", [[[1, 1], [2, 1], [2, 2], [1, 2]]], regionType="2"))
    assert static.speed_limit[static.geometry.cell(1.5, 1.5)] == pytest.approx(SLOW)
    assert np.isinf(static.speed_limit[static.geometry.cell(2.5, 1.5)])
    assert not static.blocked[static.geometry.cell(1.5, 1.5)]


def test_overlays_of_other_kinds_do_not_matter() -> None:
    plain = load()
    other = load(
        feature("Point", [1, 1], type="34", yaw="90"),
        feature("LineString", [[1, 1], [3, 2]], lineType="1"),
        feature("Polygon", [[[1, 1], [2, 1], [2, 2]]], regionType=3),
    )
    assert np.array_equal(plain.blocked, other.blocked)


@pytest.mark.parametrize("png", [b"", b"no png", Hall(4, 3).map().png[:90]])
def test_bad_png_is_refused(png: bytes) -> None:
    with pytest.raises(MoveFailed, match="PNG") as failed:
        load_map(Hall(4, 3).map().model_copy(update={"png": png}), SLOW)
    assert failed.value.reason is MoveFailReason.GET_MAP_FAILED


@pytest.mark.parametrize(
    "bad",
    [
        feature("LineString", [[1, 1]], lineType=2),
        feature("LineString", [[1, float("nan")], [2, 2]], lineType=2),
        feature("Polygon", [], regionType=1),
        feature("Polygon", "here", regionType=1),
        feature("Polygon", [[[1, 1], [2, 1], [2, 2]]], regionType="one"),
        {"type": "Feature"},
    ],
)
def test_bad_overlay_is_refused_and_named(bad: dict) -> None:
    with pytest.raises(MoveFailed, match=r"features\[1\]") as failed:
        load(feature("Point", [1, 1], type=9), bad)
    assert failed.value.reason is MoveFailReason.GET_MAP_FAILED
