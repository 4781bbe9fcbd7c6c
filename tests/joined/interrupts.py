"""What interrupts a running move, one way after another: each ends or holds it as documented, and the job goes on."""

from __future__ import annotations

from collections.abc import Callable

from rackhand.schemas.chassis import SetControlMode, SetEmergencyStop
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from tests.joined.chassis import JoinedChassis, Json

Again = Callable[[], int]
REST = 0.7  # s that braking takes at most here


def stop(driver: JoinedChassis, move: int, again: Again) -> int:
    """An emergency stop holds it; released, it goes on by itself."""
    del again
    driver.ask(SetEmergencyStop(enable=True))
    rests(driver)
    assert (driver.move(move).state, driver.planning_state.message) == ("moving", "the emergency stop is on")
    driver.ask(SetEmergencyStop(enable=False))
    return move


def cancel(driver: JoinedChassis, move: int, again: Again) -> int:
    driver.cancel()
    ended(driver, move, "cancelled")
    return again()


def remote(driver: JoinedChassis, move: int, again: Again) -> int:
    driver.ask(SetControlMode(control_mode="remote"))
    ended(driver, move, "cancelled")
    driver.ask(SetControlMode(control_mode="auto"))
    return again()


def replace(driver: JoinedChassis, move: int, again: Again) -> int:
    """By the same move: it goes on where the former one was."""
    following = again()
    assert (driver.move(move).state, driver.planning_state.action_id) == ("cancelled", following)
    return following


def kill(driver: JoinedChassis, move: int, again: Again) -> int:
    """The planner is killed, and another one starts with what is in the store."""
    load = driver.core._motion.load.state
    driver.restart()
    assert driver.core._motion.load.state is load
    ended(driver, move, "failed")
    assert driver.move(move).fail_reason == Reason.PLATFORM_ALERT_ERROR
    return again()


ALL = (stop, cancel, remote, replace, kill)


def interrupt(driver: JoinedChassis, move: int, body: Json, *overlays: Json) -> int:
    """Interrupt a move in every way, and ask for it anew where it has ended; the move that runs now. ``overlays``: of
    the map, which is chosen anew after a restart."""

    def again() -> int:
        if driver.planning_state.map_uid != uid:
            driver.overlay(*overlays)
        following = driver.post(body)
        driver.world.advance(0.4)
        return following

    uid = driver.planning_state.map_uid
    for way in ALL:
        move = way(driver, move, again)
        driver.world.advance(0.2)
        assert driver.move(move).state == "moving", (way.__name__, driver.move(move))
    return move


def ended(driver: JoinedChassis, move: int, state: str) -> None:
    """It is over, it says so everywhere, and the chassis stands."""
    rests(driver)
    shown = driver.planning_state
    assert driver.move(move).state == state == shown.move_state and shown.action_id == move


def rests(driver: JoinedChassis) -> None:
    driver.world.advance(REST)
    before = driver.world.true_pose(driver.name)
    driver.world.advance(0.2)
    after = driver.world.true_pose(driver.name)
    assert max(abs(before.x - after.x), abs(before.y - after.y), abs(before.yaw - after.yaw)) < 2e-3
