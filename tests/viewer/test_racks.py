"""What is drawn of racks."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.racks import LoadReport
from rackhand.services.viewer import colours
from rackhand.services.viewer.chassis import ChassisView
from rackhand.services.viewer.items import MAP, Drawing, Note
from tests.gateway import messages


@pytest.fixture
def view() -> ChassisView:
    return ChassisView("amr1")


def drawn(items: Any) -> dict[str, Drawing]:
    return {item.entity.removeprefix("amr1/"): item for item in items if isinstance(item, Drawing)}


def strip(drawing: Drawing) -> np.ndarray:
    """The points of its one line, (n, 3); none where it draws nothing."""
    strips = drawing.parts[0].strips.as_arrow_array().to_pylist()
    return np.array(strips[0] if strips else []).reshape(-1, 3)


def points(drawing: Drawing) -> np.ndarray:
    return np.array(drawing.parts[0].positions.as_arrow_array().to_pylist()).reshape(-1, 3)


def test_the_outline_in_force_goes_with_the_robot(view: ChassisView) -> None:
    drawing = drawn(view.outline(messages.footprint()))["outline"]
    assert drawing.frame == view.frame and drawing.lasting
    corners = strip(drawing)
    assert corners[0] == pytest.approx(corners[-1]) and np.ptp(corners[:, :2], axis=0) == pytest.approx([0.6, 0.4])


def test_a_carried_rack_goes_with_the_robot_and_one_on_the_floor_stays(view: ChassisView) -> None:
    carried = drawn(view.load(messages.load()))  # 0.5 m ahead, turned to the left; 1.2 m and margins of 0.1 and 0.2 m
    assert carried["rack/carried"].frame == view.frame
    low, high = strip(carried["rack/carried"])[:, :2].min(axis=0), strip(carried["rack/carried"])[:, :2].max(axis=0)
    assert low == pytest.approx([0.0, -0.8]) and high == pytest.approx([1.0, 0.7])
    assert len(strip(carried["rack/floor"])) == 0
    floor = drawn(view.load(messages.load("under_rack", Pose2(x=7.0, y=3.0, yaw=0.0))))
    assert floor["rack/floor"].frame == MAP and len(strip(floor["rack/carried"])) == 0
    assert strip(floor["rack/floor"])[:, :2].max(axis=0) == pytest.approx([7.7, 3.5])
    gone = drawn(view.load(LoadReport(stamp=0)))
    assert len(strip(gone["rack/floor"])) == len(strip(gone["rack/carried"])) == 0


def test_the_log_has_changes_of_the_load_once(view: ChassisView) -> None:
    def notes(load: LoadReport) -> list[str]:
        return [item.text for item in view.load(load) if isinstance(item, Note)]

    assert notes(messages.load()) == ["load: carrying"]
    assert notes(messages.load()) == []
    assert notes(messages.load("under_rack")) == ["load: under rack"]


def test_a_detected_rack_has_legs_size_and_staging_pose(view: ChassisView) -> None:
    found = drawn(view.detected_rack(messages.detected_rack()))
    assert points(found["rack/legs"])[:, :2] == pytest.approx(messages.detected_rack().legs, abs=1e-6)
    sides = np.diff(strip(found["rack/detected"])[:3, :2], axis=0)
    assert np.hypot(sides[:, 0], sides[:, 1]) == pytest.approx([1.19, 0.91], abs=1e-5)
    arrow = found["rack/staging"].parts[0]
    assert arrow.origins.as_arrow_array().to_pylist()[0][:2] == pytest.approx([2.5, 2.4])
    assert math.atan2(*reversed(arrow.vectors.as_arrow_array().to_pylist()[0][:2])) == pytest.approx(0.02, abs=1e-5)


def test_what_was_detected_vanishes_with_a_search_that_finds_nothing(view: ChassisView) -> None:
    nothing = drawn(view.detected_rack(messages.detected_rack(detected=False)))
    assert len(points(nothing["rack/legs"])) == len(strip(nothing["rack/detected"])) == 0
    assert len(nothing["rack/staging"].parts[0].vectors.as_arrow_array()) == 0


@pytest.mark.parametrize("map_first", [True, False])
def test_rack_points_have_the_colour_of_their_state(view: ChassisView, map_first: bool) -> None:
    def feature(name: str, x: float) -> dict[str, Any]:
        geometry = {"type": "Point", "coordinates": [x, 1.0]}
        return {"type": "Feature", "id": name, "geometry": geometry, "properties": {"type": "34", "name": name}}

    current = messages.current_map()
    assert current.map is not None
    overlays = {"features": [feature("storage-1", 1.0), feature("storage-2", 4.0)]}
    current = current.model_copy(update={"map": current.map.model_copy(update={"overlays": overlays})})
    states = messages.rack_states("free")
    calls = [lambda: view.map(current), lambda: view.rack_states(states)]
    for call in calls if map_first else reversed(calls):
        drawing = drawn(call())["rack/points"]
    assert points(drawing)[:, :2] == pytest.approx(np.array([[1.0, 1.0], [4.0, 1.0]]))
    shades = drawing.parts[0].colors.as_arrow_array().to_pylist()
    wanted = [int.from_bytes(bytes(colour)) for colour in (colours.FREE, colours.AREA)]
    assert shades == wanted, "of the second nothing is known"


def test_racks_on_the_floor_are_drawn_where_they_were_measured(view: ChassisView) -> None:
    drawing = drawn(view.seen_racks(messages.seen_racks(Pose2(x=7.0, y=3.0, yaw=0.0), Pose2(x=1.0, y=1.0, yaw=0.0))))
    lines = drawing["rack/seen"].parts[0].strips.as_arrow_array().to_pylist()
    farthest = [np.max(points, axis=0)[:2] for points in lines]
    assert farthest == [pytest.approx([7.7, 3.5]), pytest.approx([1.7, 1.5])]
    nothing = drawn(view.seen_racks(messages.seen_racks()))["rack/seen"]
    assert len(strip(nothing)) == 0
