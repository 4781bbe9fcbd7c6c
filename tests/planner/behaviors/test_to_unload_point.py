"""Where the chassis must be for its rack to be at a point; the moves themselves are in tests/joined/test_unload.py."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import MoveCreate
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.behaviors.to_unload_point import chassis_goal, check_cargo, target_of
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.load import Load, LoadState
from rackhand.services.planner.map.overlays import parse_overlays
from tests.planner.map.test_grid import feature

COORDINATE = st.floats(-20, 20)
ANGLE = st.floats(-math.pi, math.pi)
OFF = st.tuples(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-0.2, 0.2))
OVERLAYS = parse_overlays(
    {
        "type": "FeatureCollection",
        "features": [
            feature("Point", [2.0, 1.0], type=34, name="p1", yaw="90"),
            feature("Point", [6.0, 1.0], type=34, name="p2"),
        ],
    }
)


def carrying(rack_pose: tuple[float, float, float]) -> Load:
    return Load(state=LoadState.CARRYING, spec=RackSpec(width=0.83, depth=0.83), rack_pose=rack_pose)


@given(COORDINATE, COORDINATE, ANGLE, OFF)
def test_with_the_chassis_at_its_goal_the_rack_is_at_the_point(
    x: float, y: float, yaw: float, off: tuple[float, float, float]
) -> None:
    rack = se2.compose(chassis_goal(carrying(off), x, y, yaw), np.array(off))
    assert rack[:2] == pytest.approx((x, y), abs=1e-9)
    assert math.cos(rack[2] - yaw) == pytest.approx(1.0)


def test_the_heading_is_that_of_the_request_or_else_of_the_rack_point() -> None:
    near = {"type": "to_unload_point", "target_x": 2.1, "target_y": 1.1}
    assert target_of(MoveCreate(**near), OVERLAYS, 0.3).yaw == pytest.approx(math.pi / 2)
    assert target_of(MoveCreate(**near, target_ori=0.3), OVERLAYS, 0.3).yaw == 0.3
    assert target_of(MoveCreate(**near), OVERLAYS, 0.1).yaw is None
    assert target_of(MoveCreate(**near | {"target_x": 6.0, "target_y": 1.0}), OVERLAYS, 0.3).yaw is None
    assert "'p1'" in str(target_of(MoveCreate(**near), OVERLAYS, 0.3))


def test_a_level_that_the_point_does_not_have_is_refused() -> None:
    move = MoveCreate(type="to_unload_point", target_x=2.0, target_y=1.0, properties={"rack_layer": 2})
    with pytest.raises(MoveFailed) as failed:
        target_of(move, OVERLAYS, 0.3)
    assert failed.value.reason is Reason.INVALID_RACK_DETECTION_POS


@pytest.mark.parametrize(
    ("load", "progress", "text"),
    [
        (Load(), 1.0, "free"),
        (Load.under(RackSpec(width=0.83, depth=0.83), np.zeros(3)), 0.0, "under_rack"),
        (carrying((0.0, 0.0, 0.0)), 0.43, "43%"),
        (carrying((0.0, 0.0, 0.0)), None, "unknown"),
    ],
)
def test_without_a_rack_on_a_raised_jack_there_is_nothing_to_unload(
    load: Load, progress: float | None, text: str
) -> None:
    with pytest.raises(MoveFailed, match=text) as failed:
        check_cargo(load, progress)
    assert failed.value.reason is Reason.CARGO_READY_NOT_TRIGGERED
    check_cargo(carrying((0.0, 0.0, 0.0)), 1.0)
