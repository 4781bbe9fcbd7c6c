"""Choosing a map is all or nothing; large maps are driven on."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from PIL import Image, ImageOps

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import GetMap, PatchMap, SelectMap
from rackhand.schemas.refusal import RequestRefused
from rackhand.services.planner.map import check, grid
from rackhand.testing import distance
from tests.joined.chassis import JoinedChassis
from tests.joined.world import JoinedWorld
from tests.system.driving import standard


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[JoinedChassis]:
    """A chassis at rest at its start in an empty hall."""
    with JoinedWorld("empty", tmp_path, seed=1, with_arms=False) as world:
        world.advance(0.4)
        yield world.chassis()


def walled(width: int, height: int) -> bytes:
    """A picture of free ground with a wall around it."""
    file = io.BytesIO()
    ImageOps.expand(Image.new("L", (width - 2, height - 2), 254), 1, 0).save(file, "PNG")
    return file.getvalue()


def line(*coordinates: list[float], code: Any = 2) -> dict[str, Any]:
    geometry = {"type": "LineString", "coordinates": list(coordinates)}
    return {"type": "Feature", "geometry": geometry, "properties": {"lineType": code}}


@pytest.mark.parametrize(
    "feature",
    [
        line([0, 5], [1e300, 5]),
        line([-1e308, 5], [1e308, 5]),
        {
            "type": "Feature",
            "geometry": {"type": "Polygon", "coordinates": [[[1e300, 0], [1e300, 1e300], [9e299, 1e300]]]},
            "properties": {"regionType": 1},
        },
    ],
    ids=["far wall", "endless wall", "far zone"],
)
def test_overlays_that_leave_the_map_are_clipped(feature: dict[str, Any], driver: JoinedChassis) -> None:
    driver.overlay(feature)
    assert driver.drive(standard(1.0, 1.0), within=30.0).state == "succeeded"


def test_a_map_that_does_not_fit_leaves_the_one_in_use_and_the_running_move(
    driver: JoinedChassis, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = driver.ask_maps(GetMap()).data
    move = driver.post(standard(4.0, 0.0))
    driver.wait_until_moving()
    monkeypatch.setattr(grid, "max_cells", lambda: 1_000_000)
    with pytest.raises(RequestRefused, match="1100 x 1000 cells, at most 1,000,000 fit this machine"):
        driver.use_map(walled(1100, 1000), -3.0, -3.0, 0.05)
    with pytest.raises(RequestRefused, match="want at most"):
        monkeypatch.setattr(check, "MAX_PIXELS", 1000)
        driver.use_map(walled(1100, 1000), -3.0, -3.0, 0.05)
    assert driver.ask_maps(GetMap()).data == before
    assert driver.finish(move, within=30.0).state == "succeeded"
    assert driver.drive(standard(1.0, 1.0), within=30.0).state == "succeeded"


def test_any_error_while_a_map_is_read_leaves_the_one_in_use(
    driver: JoinedChassis, monkeypatch: pytest.MonkeyPatch
) -> None:
    move = driver.post(standard(4.0, 0.0))
    driver.wait_until_moving()

    def broken(*_: Any) -> None:
        raise OverflowError("cannot convert float infinity to integer")

    with monkeypatch.context() as patched:
        patched.setattr(grid, "_draw_line", broken)
        with pytest.raises(OverflowError):
            driver.overlay(line([0, 5], [1, 5]))
    assert driver.finish(move, within=30.0).state == "succeeded"


@pytest.mark.parametrize("code", ["", None, "99", 2.5])
def test_a_code_that_is_not_known_can_be_stored_and_the_map_chosen(code: Any, driver: JoinedChassis) -> None:
    stored = driver.ask_maps(GetMap()).data
    assert stored is not None
    overlays = {"type": "FeatureCollection", "features": [line([0, 5], [1, 5], code=code)]}
    try:
        driver.ask_maps(PatchMap(id=stored.id, overlays=overlays))
    except RequestRefused as refused:
        assert code == 2.5 and "lineType: 2.5" in refused.text
        return
    driver.ask_maps(SelectMap(id=stored.id))
    assert driver.drive(standard(1.0, 0.0), within=30.0).state == "succeeded"


@pytest.mark.parametrize("metres", [85, 100])
def test_goals_near_and_far_from_the_corner_of_a_large_map(metres: int, driver: JoinedChassis) -> None:
    driver.use_map(walled(metres * 20, metres * 20), -3.0, -3.0, 0.05)
    for x in (3.0, 0.0):
        move = driver.drive(standard(x, 0.0), within=30.0)
        assert move.state == "succeeded", move
        assert distance(driver.world.true_pose("amr1"), x, 0.0) < 0.05
    far = driver.post(standard(metres - 6.0, metres - 6.0))
    driver.wait_until_moving()
    assert driver.core.take_publications() is not None
    pose = driver.world.true_pose("amr1")
    assert math.isclose(math.degrees(math.atan2(pose.y, pose.x)), 45.0, abs_tol=8.0), "straight there"
    driver.cancel(far)


def test_a_map_of_500_m_is_driven_on(driver: JoinedChassis) -> None:
    driver.use_map(walled(5000, 5000), -250.0, -250.0, 0.1)
    assert driver.drive(standard(2.0, 1.0), within=30.0).state == "succeeded"
    driver.post(standard(240.0, 240.0))
    driver.wait_until_moving(1.0)
    pose = driver.world.true_pose("amr1")
    assert pose.x > 2.3 and pose.y > 1.3
    move = driver.drive(standard(600.0, 0.0), within=5.0)
    assert move.fail_reason == MoveFailReason.ENDING_POINT_OUT_OF_MAP
