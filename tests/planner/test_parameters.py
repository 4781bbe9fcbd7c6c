"""Parameters of a chassis: their ranges, what is in force, that a running move obeys them, and that they persist."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from rackhand.schemas.chassis import ChassisModel, SetControlMode
from rackhand.schemas.parameters import (
    KEYS,
    GetParameters,
    ParameterChanges,
    Parameters,
    ParametersReply,
    ParametersRequest,
    SetParameters,
)
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.behaviors.base import Drive
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.parameters import ParameterStore, check, commanded, defaults, in_force, merged
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.settings import Limits, NavigationSettings
from rackhand.worlds.chassis_model import load_profile
from tests.planner.fakes import Cell
from tests.planner.plant import Plant, Robot
from tests.planner.test_modes import remote

LONGJACK = Limits()
OTHER_KEYS = {"smooth_level", "auto_hold", "bump_tolerance", "bump_based_speed_limit"}


def put(cell: Cell, **changes: Any) -> Parameters:
    request = SetParameters(changes=ParameterChanges(**changes))
    return cell.chassis.parameters.answer(ParametersRequest(request=request)).values


def get(cell: Cell) -> ParametersReply:
    return cell.chassis.parameters.answer(ParametersRequest(request=GetParameters()))


# -- rules -----------------------------------------------------------------------------------------------------------


def test_every_parameter_has_a_key_and_may_be_changed() -> None:
    assert set(KEYS) == set(Parameters.model_fields) == set(ParameterChanges.model_fields)


def test_the_defaults_are_the_limits_of_the_chassis() -> None:
    values = defaults(LONGJACK)
    assert values.model_dump(exclude=OTHER_KEYS) == {
        "max_forward_velocity": 1.2,
        "max_backward_velocity": -0.2,
        "max_forward_acc": 0.5,
        "max_forward_decel": -2.0,
        "max_angular_velocity": 1.2,
    }
    assert commanded(values, LONGJACK) == LONGJACK
    check(ParameterChanges(**values.model_dump()), LONGJACK)  # what was read may be written back


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("max_forward_velocity", 1.3, "0 … 1.2 m/s"),
        ("max_forward_velocity", -0.1, "0 … 1.2 m/s"),
        ("max_backward_velocity", -0.3, "-0.2 … 0 m/s"),
        ("max_backward_velocity", 0.1, "-0.2 … 0 m/s"),
        ("max_forward_acc", 0.6, "0.1 … 0.5 m/s²"),
        ("max_forward_acc", 0.0, "0.1 … 0.5 m/s²"),
        ("max_forward_decel", -2.1, "-2 … -0.1 m/s²"),
        ("max_forward_decel", 0.0, "-2 … -0.1 m/s²"),
        ("max_angular_velocity", 1.25, "0 … 1.2 rad/s"),
        ("bump_tolerance", 1.5, "0 … 1"),
    ],
)
def test_a_value_out_of_range_is_refused_by_its_name(name: str, value: float, allowed: str) -> None:
    with pytest.raises(RequestRefused) as refused:
        check(ParameterChanges(**{name: value}), LONGJACK)
    assert refused.value.code is RefusalCode.INVALID
    assert refused.value.text == f"{KEYS[name]}: {value:g} is not in {allowed}"


def test_a_request_names_all_its_faults() -> None:
    with pytest.raises(RequestRefused) as refused:
        check(ParameterChanges(max_forward_velocity=9.0, max_forward_acc=0.3, bump_tolerance=-1.0), LONGJACK)
    assert [text.split(":")[0] for text in refused.value.text.split("; ")] == [
        "/wheel_control/max_forward_velocity",
        "/control/bump_tolerance",
    ]


def test_later_changes_go_before_earlier_ones_and_false_is_a_value() -> None:
    first = ParameterChanges(max_forward_velocity=0.5, auto_hold=False)
    second = merged(first, ParameterChanges(max_forward_velocity=0.0, smooth_level="higher"))
    values = in_force(second, LONGJACK)
    assert (values.max_forward_velocity, values.auto_hold, values.smooth_level) == (0.0, False, "higher")
    assert values.max_forward_acc == LONGJACK.max_forward_acc


def test_what_was_set_on_a_faster_chassis_is_brought_into_range() -> None:
    fast = ParameterChanges(max_forward_velocity=2.0, max_forward_decel=-3.0, max_forward_acc=0.4)
    assert commanded(in_force(fast, LONGJACK), LONGJACK) == LONGJACK._replace(max_forward_acc=0.4)


def test_foreseen_stops_are_as_gentle_as_the_parameters_and_protective_ones_as_short_as_the_chassis_can() -> None:
    gentle = NavigationSettings().commanding(LONGJACK._replace(max_forward_decel=-0.2))
    assert gentle.approach_decel == pytest.approx(0.8 * 0.2)
    assert gentle.own.max_forward_decel == -2.0
    assert NavigationSettings().commanding(LONGJACK).approach_decel == pytest.approx(0.4)
    slow_start = NavigationSettings().commanding(LONGJACK._replace(max_forward_acc=0.25))
    assert slow_start.approach_decel == pytest.approx(0.2)


# -- a chassis -------------------------------------------------------------------------------------------------------


def test_a_running_move_obeys_at_once(cell: Cell) -> None:
    """The script wants 0.5 m/s; the chassis of this cell accelerates at once and brakes at 2 m/s²."""
    cell.create()
    assert cell.tick(3).twist.linear == pytest.approx(0.5)
    assert put(cell, max_forward_velocity=0.3).max_forward_velocity == 0.3
    assert cell.tick().twist.linear == pytest.approx(0.5 - 2.0 * 0.04)
    assert cell.tick(5).twist.linear == pytest.approx(0.3)
    put(cell, max_forward_velocity=1.2, max_forward_acc=0.5)
    assert cell.tick().twist.linear == pytest.approx(0.3 + 0.5 * 0.04)


def test_one_bad_value_changes_nothing(cell: Cell) -> None:
    before = get(cell)
    with pytest.raises(RequestRefused, match="max_angular_velocity: 99 is not in"):
        put(cell, max_forward_velocity=0.3, max_angular_velocity=99.0)
    assert get(cell) == before
    cell.create()
    assert cell.tick(10).twist.linear == pytest.approx(0.5)


@pytest.mark.parametrize("name", ["max_forward_velocity", "max_angular_velocity"])
def test_a_velocity_of_0_holds_the_move_until_it_is_raised(cell: Cell, name: str) -> None:
    move = cell.create()
    cell.tick(3)
    put(cell, **{name: 0.0})
    cell.run_until(lambda: cell.twist == STANDSTILL, most=20)
    cell.tick(3000)  # two minutes: no timeout of the move counts
    assert cell.get(move.id).state == "moving"
    assert cell.planning().message == f"the maximum {name[4:].replace('_', ' ')} is set to 0"
    put(cell, **{name: 1.0})
    assert cell.tick(3).twist.linear == pytest.approx(0.5)


def test_remote_driving_obeys_too(cell: Cell) -> None:
    cell.ask(SetControlMode(control_mode="remote"))
    put(cell, max_forward_velocity=0.1, max_backward_velocity=-0.05)
    for wanted, driven in ((5.0, 0.1), (-5.0, -0.05)):
        for _ in range(60):
            cell.ask(remote(wanted))
            cell.tick()
        assert cell.twist.linear == pytest.approx(driven)


def test_parameters_outlast_a_restart_and_the_defaults_are_told_beside(make_cell: Callable[..., Cell]) -> None:
    first = make_cell()
    defaults_before = get(first).defaults
    put(first, max_forward_velocity=0.25, smooth_level="lower", auto_hold=False)
    put(first, bump_tolerance=0.75)
    told = get(first)
    first.database.close()
    second = make_cell(path=first.path)
    assert get(second) == told
    assert told.defaults == defaults_before and told.values.bump_tolerance == 0.75
    second.create()
    assert second.tick(20).twist.linear == pytest.approx(0.25)


def test_parameters_outlast_a_new_run_of_the_driver_and_a_new_model(cell: Cell) -> None:
    put(cell, max_forward_velocity=0.25)
    cell.chassis.reset("driver restarted")
    model = cell.chassis._state.model
    assert model is not None
    cell.chassis.on_message(model.model_copy(update={"wheel_radius": 0.1}))
    cell.sense()
    cell.create()
    assert cell.tick(20).twist.linear == pytest.approx(0.25)


def test_before_the_driver_has_described_the_chassis_nothing_is_known(cell: Cell) -> None:
    cell.motion._body = None
    with pytest.raises(RequestRefused, match="has not published the chassis' model") as refused:
        get(cell)
    assert refused.value.code is RefusalCode.UNAVAILABLE


def test_a_jackal_has_parameters_of_its_own(cell: Cell) -> None:
    longjack = get(cell).defaults
    jackal: ChassisModel = load_profile("jackal").describe()
    cell.chassis.on_message(jackal)
    values = get(cell).values
    assert values.max_forward_velocity == jackal.limits.forward > longjack.max_forward_velocity
    assert put(cell, max_forward_velocity=1.9).max_forward_velocity == 1.9


# -- driving ---------------------------------------------------------------------------------------------------------


def test_a_lower_velocity_caps_a_real_move_while_it_runs(begin: Callable[..., tuple[Robot, Plant]]) -> None:
    """5 m along the free side of the hall; after 4 s the cap comes down to 0.3 m/s, and the move still arrives."""
    robot, plant = begin(pose=(1.5, 1.5, 0.0))
    robot.start(Goal(8.0, 1.5, 0.0))
    fastest_after, lowered = 0.0, False
    for tick in range(1500):
        told = robot.tick()
        plant.drive(told.twist)
        if tick == 100:
            assert told.twist.linear > 0.8
            robot.motion.set_limits(robot.motion.settings.control._replace(max_forward_velocity=0.3))
            lowered = True
        if tick > 100 + 0.9 / 2.0 / 0.04 + 1:  # braked from 1.2 m/s at 2 m/s²
            fastest_after = max(fastest_after, told.twist.linear)
        if told.arrived:
            break
    assert lowered and told.arrived and plant.contacts == []
    assert 0.28 < fastest_after <= 0.3


def test_an_obstacle_is_braked_for_with_all_the_chassis_can_whatever_the_parameters(
    begin: Callable[..., tuple[Robot, Plant]],
) -> None:
    robot, plant = begin(pose=(1.5, 1.5, 0.0))
    robot.start(Goal(8.0, 1.5, 0.0))
    for _ in range(75):
        plant.drive(robot.tick().twist)
    speed = robot.motion._guard.command.linear
    robot.motion.set_limits(robot.motion.settings.control._replace(max_forward_decel=-0.1))
    assert isinstance(robot.motion.step(robot.state), Drive)
    assert robot.hold().linear == pytest.approx(speed - 2.0 * 0.04)


def test_a_record_that_cannot_be_read_is_named(cell: Cell) -> None:
    cell.database.set("parameters", '{"max_forward_velocity": "fast"}')
    with pytest.raises(Exception, match="the parameters in the store cannot be read: max_forward_velocity"):
        ParameterStore(cell.database)
