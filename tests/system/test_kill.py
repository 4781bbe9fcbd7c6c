"""``kill -9`` during a move: wheels stop, the service comes back, the record is honest, the next move works."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.world import Reset
from rackhand.testing import Cell, Judge, distance
from tests.system.driving import Driver, standard


@pytest.fixture(scope="module")
def driver(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Driver]:
    """Real time, as on a robot: what is killed leaves the others running, and comes back for the next test."""
    with Cell(tmp_path_factory.mktemp("cell"), lockstep=False) as cell, Judge(cell.bus) as judge:
        driver = Driver(cell, judge)
        yield driver
        driver.close()


def start_moving(driver: Driver) -> int:
    pose = driver.judge.true_pose("amr1")
    move = driver.post(standard(8.5 if pose.x < 6.0 else 3.0, 1.5, 0.0))
    driver.wait_until_moving(pose.x, pose.y, by=0.6)
    return move


def next_move_succeeds(driver: Driver) -> None:
    pose = driver.judge.true_pose("amr1")
    goal_x = 4.0 if pose.x > 5.0 else 7.0
    move = driver.drive(standard(goal_x, 1.5, 0.0))
    assert move["state"] == "succeeded", move
    assert distance(driver.judge.true_pose("amr1"), goal_x, 1.5) <= 0.05


def test_the_wheels_stop_when_the_planner_is_killed(driver: Driver) -> None:
    move = start_moving(driver)
    former = driver.cell.kill("planner")
    stop = driver.judge.stopped_after(silent="amr1")
    assert stop <= 0.2, f"the wheels stood {stop:.3f} s of simulation time after the last command"
    driver.cell.wait_until_restarted("planner", former)
    driver.cell.wait_until_up()
    record = driver.move(move)
    assert record["state"] == "failed"
    assert record["fail_reason"] == MoveFailReason.PLATFORM_ALERT_ERROR
    assert "restart" in record["fail_message"]
    driver.wait_until_joined()
    next_move_succeeds(driver)


def test_a_move_goes_on_when_the_gateway_is_killed(driver: Driver) -> None:
    move = start_moving(driver)
    former = driver.cell.kill("gateway")
    driver.cell.wait_until_restarted("gateway", former)
    driver.cell.wait_until_up()
    assert driver.finish(move)["state"] == "succeeded"
    next_move_succeeds(driver)


def test_a_move_fails_when_the_driver_is_killed(driver: Driver) -> None:
    """Here the driver is the simulator: with it the world is gone, and begins anew."""
    move = start_moving(driver)
    former = driver.cell.kill("sim")
    driver.cell.wait_until_restarted("sim", former)
    driver.cell.wait_until_up()
    record = driver.move(move)
    assert record["state"] == "failed"
    assert record["fail_reason"] == MoveFailReason.PLATFORM_ALERT_ERROR
    driver.wait_until_joined()
    next_move_succeeds(driver)


def test_health_tells_who_is_missing(driver: Driver) -> None:
    driver.cell.kill("planner")
    assert "amr1/planner" in driver.cell.wait_until_down("amr1/planner").down
    driver.cell.wait_until_up()
    driver.wait_until_joined()


def test_a_reset_world_fails_the_running_move_honestly(driver: Driver) -> None:
    move = start_moving(driver)
    driver.judge.ask(Reset())
    assert driver.finish(move)["fail_reason"] == MoveFailReason.PLATFORM_ALERT_ERROR
    driver.wait_until_joined()
    assert driver.judge.inspect().clock.stamp < 60 * NANOSECONDS
    next_move_succeeds(driver)
