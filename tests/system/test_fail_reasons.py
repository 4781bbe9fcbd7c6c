"""Each reason a standard move can fail for, raised by its cause in the world."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator

import pytest
from PIL import Image

from rackhand.bus import Bus
from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.maps import MapRequest, SelectMap
from rackhand.schemas.service import CELL, ServiceId
from rackhand.schemas.world import InjectFault, Place, Reset
from tests.system.cell import Cell, without_arms
from tests.system.driving import Driver, no_go, square, wall
from tests.system.judge import Judge, standard

ROBOT = "amr1"


@pytest.fixture(scope="module")
def module_driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driver]:
    folder = tmp_path_factory.mktemp("cell")
    options = ("--world", without_arms(folder, "empty"), "--lockstep", "--speed", "max")
    with Cell(folder, *options) as cell, Judge(cell.bus) as judge:
        driver = Driver(cell, judge)
        yield driver
        driver.close()


@pytest.fixture
def driver(module_driver: Driver) -> Driver:
    """The cell begun anew: at rest at its start, its own map, nothing broken."""
    run = module_driver.judge.inspect().clock.run
    module_driver.judge.ask(Reset(seed=1))
    module_driver.wait(lambda world: world.clock.run != run, "another run")
    module_driver.wait_until_joined()
    module_driver.use_stored_map()
    return module_driver


def start(driver: Driver) -> Pose2:
    return driver.judge.true_pose(ROBOT)


def png(width: int, height: int) -> bytes:
    """A picture of free ground."""
    file = io.BytesIO()
    Image.new("L", (width, height), 254).save(file, "PNG")
    return file.getvalue()


def ahead(driver: Driver, metres: float) -> dict[str, object]:
    """A move to a point ahead of the robot, its heading kept."""
    pose = start(driver)
    return standard(pose.x + metres, pose.y, 0.0)


def box(driver: Driver, name: str, x: float, y: float, length: float, width: float) -> None:
    driver.judge.ask(Place(name=name, pose=Pose2(x=x, y=y, yaw=0.0), size=(length, width, 0.6)))


def fault(driver: Driver, name: str) -> None:
    driver.judge.ask(InjectFault(robot=ROBOT, fault=name))  # type: ignore[arg-type]


def no_map(driver: Driver) -> int:
    with Bus(ServiceId("test", CELL), driver.cell.bus_config()) as bus:
        inbox = bus.inbox().watch_services()
        while (event := inbox.get(timeout=20)) is not None and str(getattr(event, "service", "")) != "amr1/planner":
            pass
        bus.call(topics.MAPS, MapRequest(request=SelectMap()), ROBOT)
    return driver.post(ahead(driver, 3.0))


def robot_beside_the_map(driver: Driver) -> int:
    pose = start(driver)
    driver.use_map(png(100, 100), pose.x + 2.0, pose.y - 2.5, 0.05)
    return driver.post(standard(pose.x + 4.0, pose.y, 0.0))


def goal_beside_the_map(driver: Driver) -> int:
    return driver.post(standard(500.0, 0.0, 0.0))


def robot_in_a_no_go_zone(driver: Driver) -> int:
    pose = start(driver)
    driver.overlay(no_go(*square(pose.x, pose.y, 1.0)))
    return driver.post(ahead(driver, 3.0))


def goal_in_a_no_go_zone(driver: Driver) -> int:
    pose = start(driver)
    driver.overlay(no_go(*square(pose.x + 3.0, pose.y, 0.8)))
    return driver.post(ahead(driver, 3.0))


def goal_is_where_it_stands(driver: Driver) -> int:
    pose = start(driver)
    return driver.post(standard(pose.x, pose.y, pose.yaw))


def goal_behind_virtual_walls(driver: Driver) -> int:
    pose = start(driver)
    corners = square(pose.x + 3.0, pose.y, 1.2)
    driver.overlay(wall(*corners, corners[0]))
    return driver.post(ahead(driver, 3.0))


def goal_in_a_slot_too_narrow_to_turn_into(driver: Driver) -> int:
    """A passage of 0.66 m with a right angle in it: wide enough for the inscribed circle, not for the body to turn."""
    wide, x, y = 0.66, start(driver).x + 2.0, start(driver).y
    passage = ((x + wide, y + wide / 2), (x + wide, y + 3.0)), ((x, y - wide / 2), (x + 2 * wide, y - wide / 2))
    outer = ((x, y + wide / 2), *passage[0], (x - 1.0, y + 3.0), (x - 1.0, y + 5.0), (x + 3.0, y + 5.0),
             (x + 3.0, y + 3.0), (x + 2 * wide, y + 3.0), *reversed(passage[1]))  # fmt: skip
    driver.overlay(wall(*outer))
    return driver.post(standard(x + 1.0, y + 4.0, 0.0))


def way_closed_for_good_while_driving(driver: Driver) -> int:
    pose = start(driver)
    goal_x = pose.x + 4.5
    move = driver.post(standard(goal_x, pose.y, 0.0))
    driver.wait_until_moving(pose.x, pose.y, by=0.3)
    for number, (dx, dy, length, width) in enumerate(
        ((-0.8, 0, 0.1, 1.7), (0.8, 0, 0.1, 1.7), (0, 0.8, 1.7, 0.1), (0, -0.8, 1.7, 0.1))
    ):
        box(driver, f"side_{number}", goal_x + dx, pose.y + dy, length, width)
    return move


def wheels_that_do_not_turn(driver: Driver) -> int:
    fault(driver, "wheels_blocked")
    return driver.post(ahead(driver, 3.0))


def lidar(kind: str) -> Callable[[Driver], int]:
    def cause(driver: Driver) -> int:
        pose = start(driver)
        move = driver.post(ahead(driver, 4.0))
        driver.wait_until_moving(pose.x, pose.y, by=0.3)
        fault(driver, kind)
        return move

    return cause


def cable_plugged_in(driver: Driver) -> int:
    fault(driver, "power_cable")
    return driver.post(ahead(driver, 3.0))


def crate_in_the_way_of_turning(driver: Driver) -> int:
    pose = start(driver)
    box(driver, "left", pose.x, pose.y + 0.42, 0.6, 0.2)
    box(driver, "right", pose.x, pose.y - 0.42, 0.6, 0.2)
    return driver.post(standard(ori=1.57))


def map_changed_while_driving(driver: Driver) -> int:
    pose = start(driver)
    move = driver.post(ahead(driver, 4.0))
    driver.wait_until_moving(pose.x, pose.y, by=0.3)
    driver.use_stored_map()
    return move


def deprecated_type(driver: Driver) -> int:
    return driver.post({"creator": "test", "type": "leave_elevator", "target_x": 1.0, "target_y": 0.0})


CAUSES: list[tuple[Reason, Callable[[Driver], int]]] = [
    (Reason.GET_MAP_FAILED, no_map),
    (Reason.STARTING_POINT_OUT_OF_MAP, robot_beside_the_map),
    (Reason.ENDING_POINT_OUT_OF_MAP, goal_beside_the_map),
    (Reason.STARTING_POINT_NOT_IN_GROUND, robot_in_a_no_go_zone),
    (Reason.ENDING_POINT_NOT_IN_GROUND, goal_in_a_no_go_zone),
    (Reason.STARTING_EQUAL_ENDING, goal_is_where_it_stands),
    (Reason.CALCULATION_FAILED, goal_behind_virtual_walls),
    (Reason.NO_GLOBAL_PATH, goal_in_a_slot_too_narrow_to_turn_into),
    (Reason.PLANNING_TIMEOUT, way_closed_for_good_while_driving),
    (Reason.MOVE_TIMEOUT, wheels_that_do_not_turn),
    (Reason.CONTROL_COSTMAP_ERROR, lidar("lidar_dead")),
    (Reason.CONTROL_COSTMAP_ERROR, lidar("lidar_blind")),
    (Reason.POWER_CABLE_CONNECTED, cable_plugged_in),
    (Reason.ROTATE_TIMEOUT, crate_in_the_way_of_turning),
    (Reason.MAP_CHANGED, map_changed_while_driving),
    (Reason.MOVE_ACTION_TYPE_DEPRECATED, deprecated_type),
]


@pytest.mark.parametrize(("reason", "cause"), CAUSES, ids=lambda value: getattr(value, "rest_name", ""))
def test_a_move_fails_for_its_cause(driver: Driver, reason: Reason, cause: Callable[[Driver], int]) -> None:
    move = driver.finish(cause(driver))
    assert (move["state"], move["fail_reason"]) == ("failed", reason), move
    assert move["fail_reason_str"] == reason.rest_string
    assert move["fail_message"], "a failure says what, where and by how much"
    assert driver.judge.inspect().contact_count == 0


def test_after_every_failure_the_next_move_succeeds(driver: Driver) -> None:
    driver.finish(deprecated_type(driver))
    assert driver.drive(ahead(driver, 2.0))["state"] == "succeeded"
