"""charge in physics: how well the contacts meet, each reason to fail, raised by its cause, and leaving again."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path

import pytest
import yaml

from benchmarks.align import charger_point, hall_with_charger
from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import SetEmergencyStop
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import Move
from rackhand.schemas.world import InjectFault, MoveRobot
from rackhand.services.gateway.ws import payloads
from rackhand.services.gateway.ws.facts import Facts
from rackhand.services.planner.load import LoadState
from rackhand.worlds.data import WORLDS_PATH, known_files
from tests.joined.chassis import JoinedChassis
from tests.joined.racks import Cause, check_failure, with_jack_up
from tests.joined.world import JoinedWorld
from tests.system.driving import standard

X = -3.0  # of the docked pose, whose y and yaw are 0
CHARGE = {"type": "charge"}


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[JoinedChassis]:
    """A chassis 1.3 m before a charger that is registered 10 cm and 3° off."""
    with JoinedWorld(hall_with_charger(), tmp_path, seed=4, with_arms=False) as world:
        yield begin(world, (X + 1.3, 0.1, 0.2), charger_point("c", X + 0.06, -0.08, 3.0))


def begin(world: JoinedWorld, start: tuple[float, float, float], *overlays: dict[str, object]) -> JoinedChassis:
    driver = world.chassis()
    driver.overlay(*overlays)
    world.ask(MoveRobot(robot=driver.name, pose=Pose2(x=start[0], y=start[1], yaw=start[2])))
    world.advance(0.5)
    return driver


def fault(driver: JoinedChassis, name: str, active: bool = True) -> None:
    driver.world.ask(InjectFault(target=driver.name, fault=name, active=active))


def off(driver: JoinedChassis) -> float:
    pose = driver.world.true_pose(driver.name)
    return math.hypot(pose.x - X, pose.y)


def is_charging(driver: JoinedChassis) -> bool:
    driver.world.advance(1.1)
    battery, load = driver.core._state.battery, driver.core._motion.load
    return battery is not None and battery.charging and battery.current < 0.0 and load.state is LoadState.DOCKED


@pytest.mark.parametrize(
    ("start", "registered"),
    [
        ((-0.5, 1.2, 2.5), (X + 0.2, 0.2, 10.0)),
        ((-1.5, -1.0, -1.0), (X - 0.28, 0.05, -9.0)),
    ],
)
def test_it_charges_though_the_dock_is_off_its_registered_pose(
    tmp_path: Path, start: tuple[float, float, float], registered: tuple[float, float, float]
) -> None:
    with JoinedWorld(hall_with_charger(), tmp_path, seed=5, with_arms=False) as world:
        driver = begin(world, start, charger_point("c", *registered))
        move = driver.drive(CHARGE)
        assert move.state == "succeeded", move
        assert off(driver) < 0.01 and is_charging(driver)
        assert world.inspect().contact_count == 0
        moving = [m for t, m in driver.published if t is topics.PLANNING_STATE and m.move_state == "moving"]
        assert {m.move_intent for m in moving} == {"none", "going_back_to_charger"}
        assert moving[-1].target is None and abs(moving[-1].intent_target.x - X) < 0.04


def test_in_the_warehouse_where_the_map_shows_the_charger(tmp_path: Path) -> None:
    with JoinedWorld("warehouse", tmp_path, seed=6, with_arms=False) as world:
        driver = world.chassis()
        world.advance(0.5)
        assert driver.drive(CHARGE | {"target_x": 0.72, "target_y": 1.5, "target_ori": 0.0}).state == "succeeded"
        pose = world.true_pose(driver.name)
        assert math.hypot(pose.x - 0.72, pose.y - 1.5) < 0.01
        assert world.inspect().contact_count == 0


def test_the_next_move_first_leaves_the_charger_and_charging_again_comes_back(driver: JoinedChassis) -> None:
    assert driver.drive(CHARGE).state == "succeeded"
    again = driver.drive(CHARGE)
    assert again.fail_reason == Reason.ALREADY_IN_CHARGING and off(driver) < 0.01
    move = driver.post(standard(X + 2.0, 1.0, 1.0))
    driver.world.advance(0.6)
    assert driver.planning_state.flags == ("undocking_charger_or_rack",)
    driver.world.advance(2.0)
    assert abs(driver.world.true_pose(driver.name).y) < 0.03, "straight out"
    assert driver.finish(move).state == "succeeded"
    assert driver.core._motion.load.state is LoadState.FREE
    assert driver.drive(CHARGE).state == "succeeded" and is_charging(driver)
    assert driver.world.inspect().contact_count == 0


def quick_profile(folder: Path) -> str:
    """The longjack with its contacts at the front, and a battery that a whole cycle takes seconds of; its name."""
    profile = yaml.safe_load(known_files("chassis/*.yaml")["longjack"].read_text())
    profile |= {"name": "quick", "charge_contact": "front"}
    profile["battery"]["capacity"] = 0.8
    (folder / "chassis").mkdir()
    (folder / "chassis" / "quick.yaml").write_text(yaml.safe_dump(profile))
    return "quick"


def test_a_whole_cycle_on_contacts_at_the_front(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From 20 % on it empties while it stands and drives, is charged until it is full, and leaves backward."""
    monkeypatch.setenv(WORLDS_PATH, str(tmp_path))
    empty = hall_with_charger()
    robots = {"amr1": empty.robots["amr1"].model_copy(update={"battery": 0.2})}
    hall, profile = empty.model_copy(update={"robots": robots}), quick_profile(tmp_path)
    with JoinedWorld(hall, tmp_path, seed=4, profile=profile, with_arms=False) as world:
        driver = begin(world, (X + 1.4, 0.1, 2.9), charger_point("c", X + 0.06, -0.08, 3.0))
        supply: list[tuple[str, float]] = []

        def sample(done: Callable[[], bool]) -> bool | None:
            battery = driver.core._state.battery
            if battery is not None and (shown := payloads.battery_state(Facts({topics.BATTERY: battery}))):
                supply.append((shown.power_supply_status, shown.percentage))
            return done() or None

        move = driver.post(CHARGE)
        world.wait_for(lambda: sample(lambda: driver.move(move).state != "moving"), "it charges", 60.0, step=0.5)
        ended = driver.move(move)
        assert (ended.state, ended.is_charging) == ("succeeded", True) and off(driver) < 0.01, ended
        assert abs(abs(world.true_pose(driver.name).yaw) - math.pi) < 0.02, "its front is at the dock"
        world.wait_for(lambda: sample(lambda: supply[-1][0] == "full"), "it is full", 60.0, step=0.5)
        assert [status for status, _ in groupby(status for status, _ in supply)] == ["discharging", "charging", "full"]
        levels = [level for status, level in supply if status == "charging"]
        assert levels == sorted(levels) and levels[0] < 0.2
        codes = [[alert.code for alert in m.alerts] for t, m in driver.published if t is topics.CHASSIS_STATUS]
        assert [code for code, _ in groupby(codes)][-3:] == [[8501], [8003], []]

        assert driver.drive(CHARGE).fail_reason == Reason.ALREADY_IN_CHARGING
        leaving = driver.post(standard(X + 2.0, 0.0))
        world.advance(1.5)
        pose = world.true_pose(driver.name)
        assert pose.x > X + 0.1 and abs(abs(pose.yaw) - math.pi) < 0.05, "backward"
        assert driver.finish(leaving).state == "succeeded"
        world.wait_for(lambda: sample(lambda: supply[-1][1] < 0.95), "it empties", 10.0)
        assert supply[-1][0] == "discharging" and world.inspect().contact_count == 0


def test_along_a_route(driver: JoinedChassis) -> None:
    move = driver.post(CHARGE | {"route_coordinates": f"{X + 1.6}, 0.4, {X + 1.6}, 1.6", "detour_tolerance": 0.3})
    driver.world.wait_for(lambda: driver.planning_state.passed_points == 2 or None, "the route's end", 60.0)
    assert abs(driver.world.true_pose(driver.name).y - 1.6) < 0.05
    assert driver.finish(move).state == "succeeded" and is_charging(driver)
    assert driver.move(move).is_charging is True
    assert driver.world.inspect().contact_count == 0


def no_contact(driver: JoinedChassis) -> Move:
    fault(driver, "no_charge_contact")
    return driver.drive(CHARGE | {"charge_retry_count": 1})


def no_contact_and_no_retries(driver: JoinedChassis) -> Move:
    fault(driver, "no_charge_contact")
    return driver.drive(CHARGE)


def no_current(driver: JoinedChassis) -> Move:
    fault(driver, "no_charge_current")
    return driver.drive(CHARGE)


def no_dock_where_it_is_registered(driver: JoinedChassis) -> Move:
    driver.overlay(charger_point("c", 1.0, 1.0, 0.0))
    return driver.drive(CHARGE)


def target_far_from_any(driver: JoinedChassis) -> Move:
    return driver.drive(CHARGE | {"target_x": X + 2.0, "target_y": 0.0, "target_ori": 0.0})


def no_charger_on_the_map(driver: JoinedChassis) -> Move:
    driver.overlay()
    return driver.drive(CHARGE)


def jack_up(driver: JoinedChassis) -> Move:
    return with_jack_up(driver, CHARGE)


CAUSES: list[tuple[Reason, str, Cause]] = [
    (Reason.CHARGE_RETRY_COUNT_EXCEEDED, "did not meet those of charger 'c' in 2 attempts", no_contact),
    (Reason.CHARGE_DOCK_SIGNAL_ERROR, "in 1 attempts", no_contact_and_no_retries),
    (Reason.CHARGE_DOCK_DETECTION_ERROR, "no V of two plates is seen", no_dock_where_it_is_registered),
    (Reason.NO_CHARGE_CURRENT, "no current flowed for 10 s", no_current),
    (Reason.INVALID_CHARGE_DOCK, "the nearest is 'c' at (-2.94, -0.08), 1.94 m away", target_far_from_any),
    (Reason.INVALID_CHARGE_DOCK, "no charger is registered on the map", no_charger_on_the_map),
    (Reason.JACK_IN_UP_STATE, "the jack is at 100%", jack_up),
]


@pytest.mark.parametrize(("reason", "text", "cause"), CAUSES, ids=[cause.__name__ for *_, cause in CAUSES])
def test_it_fails_for_its_cause(driver: JoinedChassis, reason: Reason, text: str, cause: Cause) -> None:
    check_failure(driver, cause, reason, text)


def test_a_charger_that_gave_no_current_is_docked_to_anew(driver: JoinedChassis) -> None:
    no_current(driver)
    fault(driver, "no_charge_current", active=False)
    driver.drive(standard(X + 1.5, 0.5))
    assert driver.drive(CHARGE).state == "succeeded" and is_charging(driver)


def test_an_emergency_stop_before_the_contacts_holds_it(driver: JoinedChassis) -> None:
    move = driver.post(CHARGE)
    driver.world.wait_for(lambda: True if off(driver) < 0.3 else None, "it is near the dock", 60.0)
    driver.ask(SetEmergencyStop(enable=True))
    driver.world.advance(2.0)
    assert driver.move(move).state == "moving" and off(driver) > 0.2
    driver.ask(SetEmergencyStop(enable=False))
    assert driver.finish(move).state == "succeeded" and is_charging(driver)
