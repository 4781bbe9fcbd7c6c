"""to_unload_point in physics: where the rack ends, and each reason to fail, raised by its cause."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import JackRequest
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.world import Place, Remove
from tests.joined.chassis import JoinedChassis
from tests.joined.racks import hall_with_racks, lift, lower, put_under, rack_error, rack_point, unload
from tests.joined.world import JoinedWorld
from tests.system.driving import no_go, square, wall

OFF = (0.015, -0.01, 0.02)  # of the chassis under the rack


def hall(tmp_path: Path, kind: str = "standard") -> JoinedWorld:
    return JoinedWorld(hall_with_racks(rack=(kind, 0.0, 0.0, 0.0)), tmp_path, seed=3, with_arms=False)


@pytest.fixture
def carrying(tmp_path: Path) -> Iterator[JoinedChassis]:
    """A chassis that carries a rack in the middle of an empty hall."""
    with hall(tmp_path) as world:
        lift(world.chassis(), "rack", OFF)
        yield world.chassis()


@pytest.mark.parametrize(("kind", "yaw"), [("standard", 1.57), ("large", -2.4)])
def test_the_rack_ends_at_the_point(tmp_path: Path, kind: str, yaw: float) -> None:
    with hall(tmp_path, kind) as world:
        driver = world.chassis()
        lift(driver, "rack", OFF)
        assert driver.drive(unload(2.0, 1.5, yaw)).state == "succeeded"
        moving = [m for topic, m in driver.published if topic is topics.PLANNING_STATE and m.move_state == "moving"]
        assert all(m.target is None and m.remaining_distance == 0.0 for m in moving)
        target = moving[-1].intent_target
        assert moving[-1].flags == ("unloading_rack",) and target is not None
        assert (target.x, target.y, target.yaw) == pytest.approx((2.0, 1.5, yaw))
        lower(driver)
        metres, degrees = rack_error(driver, "rack", 2.0, 1.5, yaw)
        assert metres < 0.03 and degrees < 1.0
        assert world.inspect().contact_count == 0


def test_without_a_heading_the_rack_takes_that_of_the_rack_point(carrying: JoinedChassis) -> None:
    carrying.overlay(rack_point("a1", 1.5, 1.0, 90.0))
    assert carrying.drive(unload(1.45, 1.05)).state == "succeeded"
    metres, degrees = rack_error(carrying, "rack", 1.45, 1.05, 1.5708)
    assert metres < 0.03 and degrees < 1.0


def test_at_a_place_without_a_rack_point_any_heading_that_has_room_will_do(carrying: JoinedChassis) -> None:
    """A lane along y, too narrow for the rack at the heading that it has now."""
    carrying.overlay(wall((1.35, 1.5), (1.35, 4.0)), wall((2.65, 1.5), (2.65, 4.0)), no_go(*square(2.0, 4.3, 0.3)))
    move = carrying.drive(unload(2.0, 2.5))
    assert move.state == "succeeded", move
    assert rack_error(carrying, "rack", 2.0, 2.5, 0.0)[0] < 0.03


def test_large_rack_there_and_back_through_the_passages_of_the_warehouse(tmp_path: Path) -> None:
    with JoinedWorld("warehouse", tmp_path, seed=1, with_arms=False) as world:
        driver = world.chassis()
        lift(driver, "rack_s5")
        for x, y in ((14.6, 12.2), (5.8, 9.4)):
            move = driver.drive(unload(x, y, 1.5708))
            assert move.state == "succeeded", move
            metres, degrees = rack_error(driver, "rack_s5", x, y, 1.5708)
            assert metres < 0.03 and degrees < 1.0
        assert world.inspect().contact_count == 0


# -- the place is occupied -------------------------------------------------------------------------------------------


def crate(driver: JoinedChassis, x: float, y: float) -> None:
    driver.world.ask(Place(name="crate", pose=Pose2(x=x, y=y, yaw=0.0), size=(0.4, 0.3, 0.5)))


def test_an_occupied_point_is_503_and_free_again_it_is_taken(carrying: JoinedChassis) -> None:
    crate(carrying, 3.2, 0.1)
    move = carrying.drive(unload(3.0, 0.0, 0.0))
    assert (move.state, move.fail_reason) == ("failed", Reason.UNLOAD_POINT_OCCUPIED), move
    assert "(3.00, 0.00)" in move.fail_message and "15 s" in move.fail_message
    assert carrying.world.inspect().contact_count == 0
    carrying.world.ask(Remove(name="crate"))
    assert carrying.drive(unload(3.0, 0.0, 0.0)).state == "succeeded"


def test_what_leaves_the_point_in_time_is_waited_for(carrying: JoinedChassis) -> None:
    crate(carrying, 3.0, 0.0)
    move = carrying.post(unload(3.0, 0.0, 0.0))
    carrying.world.advance(12.0)
    carrying.world.ask(Remove(name="crate"))
    assert carrying.finish(move).state == "succeeded"
    assert carrying.world.inspect().contact_count == 0


# -- the point cannot be reached -------------------------------------------------------------------------------------


def outside_the_map(driver: JoinedChassis) -> tuple[int, str]:
    return driver.post(unload(50.0, 0.0, 0.0)), "ending_point_out_of_map"


def in_the_wall(driver: JoinedChassis) -> tuple[int, str]:
    return driver.post(unload(9.7, 0.0, 0.0)), "ending_point_not_in_ground"


def behind_virtual_walls(driver: JoinedChassis) -> tuple[int, str]:
    corners = square(3.0, 0.0, 1.2)
    driver.overlay(wall(*corners, corners[0]))
    return driver.post(unload(3.0, 0.0, 0.0)), "calculation_failed"


@pytest.mark.parametrize("cause", [outside_the_map, in_the_wall, behind_virtual_walls])
def test_a_point_that_cannot_be_reached_is_504(
    carrying: JoinedChassis, cause: Callable[[JoinedChassis], tuple[int, str]]
) -> None:
    move_id, why = cause(carrying)
    move = carrying.finish(move_id)
    assert (move.state, move.fail_reason) == ("failed", Reason.UNLOAD_POINT_UNREACHABLE), move
    assert why in move.fail_message
    assert carrying.drive(unload(1.0, 0.0, 0.0)).state == "succeeded"


# -- no cargo --------------------------------------------------------------------------------------------------------


def test_without_a_rack_on_the_jack_it_is_517(tmp_path: Path) -> None:
    with hall(tmp_path) as world:
        driver = world.chassis()
        put_under(driver, "rack")
        move = driver.drive(unload(1.0, 0.0, 0.0))
        assert (move.state, move.fail_reason) == ("failed", Reason.CARGO_READY_NOT_TRIGGERED), move
        assert "under_rack" in move.fail_message


def test_with_the_jack_stopped_halfway_it_is_517(carrying: JoinedChassis) -> None:
    carrying.ask(JackRequest(direction="down"))
    carrying.world.advance(4.0)
    carrying.core._jack.forget()
    carrying.world.advance(0.5)
    move = carrying.drive(unload(1.0, 0.0, 0.0))
    assert (move.state, move.fail_reason) == ("failed", Reason.CARGO_READY_NOT_TRIGGERED), move
    assert "%" in move.fail_message


def test_a_given_route_is_driven_first(carrying: JoinedChassis) -> None:
    move = carrying.post(unload(3.0, 0.0, 0.0, route_coordinates="0, 0, 1.2, 1.2, 2.4, 1.2"))
    farthest = 0.0
    while carrying.move(move).state == "moving":
        carrying.world.advance(0.4)
        farthest = max(farthest, carrying.world.true_pose(carrying.name).y)
    assert carrying.move(move).state == "succeeded" and farthest > 1.0
    metres, degrees = rack_error(carrying, "rack", 3.0, 0.0, 0.0)
    assert metres < 0.03 and degrees < 1.0
