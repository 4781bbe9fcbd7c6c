"""What a chassis' messages become."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Contacts, Costmap
from rackhand.schemas.moves import MoveEvent, PlannedPath
from rackhand.services.viewer.chassis import ChassisView, prism
from rackhand.services.viewer.items import Drawing, Note, Pose
from tests.gateway import messages


@pytest.fixture
def view() -> ChassisView:
    return ChassisView("amr1")


def notes(items: Any) -> list[tuple[str, str]]:
    return [(item.level, item.text) for item in items if isinstance(item, Note)]


@pytest.mark.parametrize("scan_first", [True, False])
def test_a_scan_is_drawn_at_the_pose_where_it_was_taken(view: ChassisView, scan_first: bool) -> None:
    def poses() -> list[Any]:
        found: list[Any] = []
        for stamp, x in ((40, 1.0), (80, 2.0), (120, 3.0)):
            found += view.pose(messages.pose(stamp, x=x, y=0.0, yaw=0.0))
        return found

    def scan() -> list[Any]:
        return list(view.scan(messages.scan(stamp=80)))

    items = [*scan(), *poses()] if scan_first else [*poses(), *scan()]
    (drawing,) = [item for item in items if isinstance(item, Drawing) and item.entity == "amr1/scan"]
    points = drawing.parts[0].positions.as_arrow_array().to_pylist()
    assert points[0][0] == pytest.approx(2.0 + 0.1 + 2.0)
    assert len(points) == 2, "the beam without a return is not drawn"


def test_a_robot_is_where_it_is_localised(view: ChassisView) -> None:
    pose = next(item for item in view.pose(messages.pose(x=1.0, y=2.0, yaw=math.pi)) if isinstance(item, Pose))
    assert pose.frame == view.frame and pose.parent == "map"
    assert pose.position == (1.0, 2.0, 0.0)
    assert pose.orientation == pytest.approx((0.0, 0.0, 0.0, 1.0))


def test_a_footprint_is_drawn_on_the_floor_with_an_edge_at_each_corner() -> None:
    edges = prism(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), 0.25)
    assert len(edges) == 2 + 3
    assert edges[0][:, 2] == pytest.approx(0.005) and edges[1][:, 2] == pytest.approx(0.25)
    assert (edges[0][0] == edges[0][-1]).all(), "the outline is closed"


def test_a_costmap_has_its_first_row_below(view: ChassisView) -> None:
    """Images have it above."""
    cells = np.array([0, 0, 254, 254], dtype=np.uint8)
    (drawing,) = view.costmap(Costmap(stamp=0, origin=(1.0, 2.0), resolution=0.1, columns=2, cost=cells))
    assert isinstance(drawing, Drawing)
    data = drawing.parts[0].data.as_arrow_array().to_pylist()[0]
    assert bytes(data) == bytes([254, 254, 0, 0])


def test_a_path_that_ends_vanishes(view: ChassisView) -> None:
    (drawing,) = view.path(PlannedPath(stamp=0, poses=np.zeros((0, 3))))
    assert isinstance(drawing, Drawing) and drawing.parts[0].strips.as_arrow_array().to_pylist() == []


def test_a_target_is_drawn_when_it_is_another(view: ChassisView) -> None:
    def drawn(**changes: Any) -> list[int]:
        items = view.planning_state(messages.planning(**changes))
        return [len(item.parts[0].vectors.as_arrow_array()) for item in items if isinstance(item, Drawing)]

    assert drawn() == [1]
    assert drawn(remaining_distance=1.0) == []
    assert drawn(target=Pose2(x=9.0, y=9.0, yaw=0.0)) == [1]
    assert drawn(move_state="succeeded") == [0]


def test_the_log_tells_moves_faults_and_stops_once(view: ChassisView) -> None:
    event = MoveEvent(stamp=0, move_id=7, event="blocked", text="a crate")
    assert notes(view.event(event)) == [("WARN", "move 7 blocked: a crate")]
    assert notes(view.planning_state(messages.planning())) == [("INFO", "move 7 (standard) moving")]
    assert notes(view.planning_state(messages.planning(remaining_distance=1.0))) == []
    failed = notes(view.planning_state(messages.planning(move_state="failed", fail_reason=1)))
    assert failed == [("WARN", "move 7 (standard) failed: unknown")], "in letters that Rerun's font has"
    assert notes(view.status(messages.status(emergency_stop=True))) == [("ERROR", "emergency stop")]
    assert notes(view.status(messages.status(emergency_stop=True))) == []
    assert notes(view.status(messages.status())) == [("INFO", "emergency stop released")]
    assert notes(view.contacts(Contacts(stamp=0, bumper_front=True))) == [("WARN", "bumper front: closed")]
    assert notes(view.contacts(Contacts(stamp=1, bumper_front=True))) == []
