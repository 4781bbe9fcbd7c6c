"""Parameters of a chassis: their ranges, what is in force, that a running move obeys them, and that they persist."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from rackhand.schemas import topics
from rackhand.schemas.chassis import ChassisModel, Jack, SetControlMode
from rackhand.schemas.parameters import (
    KEYS,
    NAMES,
    NO_EFFECT,
    SETTINGS,
    DriveParameterChanges,
    DriveParameters,
    GetParameters,
    ParameterChanges,
    Parameters,
    ParametersReply,
    ParametersRequest,
    SetParameters,
    Setting,
    SmoothLevel,
)
from rackhand.schemas.racks import RackSpec
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.behaviors.base import Drive
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.parameters import (
    Basis,
    ParameterStore,
    changed,
    check,
    commanded,
    defaults,
    in_force,
    load_share,
)
from rackhand.services.planner.perception.chassis_state import ChassisState
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.settings import Limits, NavigationSettings
from rackhand.worlds.chassis_model import load_profile
from tests.chassis_models import chassis_model
from tests.planner.fakes import Cell
from tests.planner.plant import Plant, Robot
from tests.planner.test_modes import remote

LONGJACK = Basis(Limits())


def put(cell: Cell, **changes: Any) -> Parameters:
    request = SetParameters(changes=ParameterChanges(**changes))
    return cell.chassis.parameters.answer(ParametersRequest(request=request)).values


def get(cell: Cell) -> ParametersReply:
    return cell.chassis.parameters.answer(ParametersRequest(request=GetParameters()))


# -- rules -----------------------------------------------------------------------------------------------------------


def test_every_parameter_has_a_key_and_may_be_changed() -> None:
    assert [row.field for row in SETTINGS] == list(Parameters.model_fields) == list(ParameterChanges.model_fields)
    assert list(KEYS) == list(DriveParameters.model_fields) == list(DriveParameterChanges.model_fields)
    assert len(set(NAMES.values())) == len(SETTINGS)


def test_the_defaults_are_the_limits_of_the_chassis() -> None:
    values = defaults(LONGJACK)
    assert values.model_dump(include=set(Limits._fields)) == {
        "max_forward_velocity": 1.2,
        "max_backward_velocity": -0.2,
        "max_forward_acc": 0.5,
        "max_forward_decel": -2.0,
        "max_angular_velocity": 1.2,
    }
    assert commanded(values, LONGJACK.limits) == LONGJACK.limits
    check(ParameterChanges(**dict(values)), LONGJACK)  # what was read may be written back


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
        ("remote_max_forward_velocity", 0.9, "0 … 0.8 m/s"),
        ("weight_min_linear", 0.0, "0.05 … 1.2 m/s"),
        ("weight_min_angular", 1.3, "0.05 … 1.2 rad/s"),
        ("footprint_expansion", -0.01, "0 … 0.5 m"),
    ],
)
def test_a_value_out_of_range_is_refused_by_its_name(name: str, value: float, allowed: str) -> None:
    with pytest.raises(RequestRefused) as refused:
        check(ParameterChanges(**{name: value}), LONGJACK)
    assert refused.value.code is RefusalCode.INVALID
    assert refused.value.text == f"{NAMES[name]}: {value:g} is not in {allowed}"
    with pytest.raises(RequestRefused) as refused:
        check(ParameterChanges(**{name: value}), LONGJACK, "robot_params")
    assert refused.value.text == f"{KEYS.get(name, NAMES[name])}: {value:g} is not in {allowed}"


def test_a_request_names_all_its_faults() -> None:
    with pytest.raises(RequestRefused) as refused:
        check(ParameterChanges(max_forward_velocity=9.0, max_forward_acc=0.3, bump_tolerance=-1.0), LONGJACK)
    assert [text.split(":")[0] for text in refused.value.text.split("; ")] == [
        "control.max_forward_velocity",
        "bump_based_speed_limit.bump_tolerance",
    ]


def test_later_changes_go_before_earlier_ones_and_false_is_a_value() -> None:
    first = ParameterChanges(max_forward_velocity=0.5, auto_hold=False)
    more = ParameterChanges(max_forward_velocity=0.0, smooth_level="higher")
    second = changed(first, SetParameters(changes=more))
    values = in_force(second, LONGJACK)
    assert (values.max_forward_velocity, values.auto_hold, values.smooth_level) == (0.0, False, "higher")
    assert values.max_forward_acc == LONGJACK.limits.max_forward_acc


def test_what_is_reset_or_left_out_of_a_replacement_returns_to_its_default() -> None:
    old = ParameterChanges(max_forward_velocity=0.5, auto_hold=False)
    reset = SetParameters(changes=ParameterChanges(bump_tolerance=0.1), reset=("auto_hold",))
    assert changed(old, reset) == ParameterChanges(max_forward_velocity=0.5, bump_tolerance=0.1)
    replaced = SetParameters(changes=ParameterChanges(auto_hold=True), replace=True)
    assert changed(old, replaced) == ParameterChanges(auto_hold=True)


@pytest.mark.parametrize(
    ("load", "linear", "angular"), [(0.0, 1.2, 1.2), (0.3, 0.84, 0.84), (0.5, 0.6, 0.7), (1.0, 0.4, 0.7)]
)
def test_a_load_lowers_velocities_down_to_the_least_that_is_set(load: float, linear: float, angular: float) -> None:
    values = in_force(ParameterChanges(weight_min_angular=0.7), LONGJACK)
    allowed = commanded(values, LONGJACK.limits, load)
    assert allowed.max_forward_velocity == pytest.approx(linear)
    assert allowed.max_angular_velocity == pytest.approx(angular)
    assert allowed.max_forward_decel == LONGJACK.limits.max_forward_decel
    off = in_force(ParameterChanges(weight_based_speed_limit=False), LONGJACK)
    assert commanded(off, LONGJACK.limits, load) == LONGJACK.limits


def test_a_load_does_not_raise_a_velocity_that_is_set_lower() -> None:
    values = in_force(ParameterChanges(max_forward_velocity=0.3), LONGJACK)
    assert commanded(values, LONGJACK.limits, 0.5).max_forward_velocity == 0.3


def test_the_share_of_a_load_counts_while_the_jack_is_not_down() -> None:
    state = ChassisState()
    assert load_share(state) == 0.0
    state.take(chassis_model())
    for progress, weight, share in ((0.0, 90.0, 0.0), (0.5, 90.0, 0.3), (1.0, -2.0, 0.0), (1.0, 400.0, 1.0)):
        state.take(Jack(stamp=0, state="hold", progress=progress, weight=weight))
        assert load_share(state) == pytest.approx(share)


def test_what_was_set_on_a_faster_chassis_is_brought_into_range() -> None:
    fast = ParameterChanges(max_forward_velocity=2.0, max_forward_decel=-3.0, max_forward_acc=0.4)
    limits = LONGJACK.limits
    assert commanded(in_force(fast, LONGJACK), limits) == limits._replace(max_forward_acc=0.4)


def test_foreseen_stops_are_as_gentle_as_the_parameters_and_protective_ones_as_short_as_the_chassis_can() -> None:
    gentle = NavigationSettings().commanding(LONGJACK.limits._replace(max_forward_decel=-0.2))
    assert gentle.approach_decel == pytest.approx(0.8 * 0.2)
    assert gentle.own.max_forward_decel == -2.0
    assert NavigationSettings().commanding(LONGJACK.limits).approach_decel == pytest.approx(0.4)
    slow_start = NavigationSettings().commanding(LONGJACK.limits._replace(max_forward_acc=0.25))
    assert slow_start.approach_decel == pytest.approx(0.2)


# -- a chassis -------------------------------------------------------------------------------------------------------


def test_a_running_move_obeys_at_once(cell: Cell) -> None:
    """The script wants 0.5 m/s; the chassis of this cell accelerates at once and brakes at 2 m/s²."""
    cell.create()
    assert cell.tick(3).twist.linear == pytest.approx(0.5)
    assert put(cell, max_forward_velocity=0.3).max_forward_velocity == 0.3
    assert cell.tick().twist.linear == pytest.approx(0.5 - 2.0 * 0.04)
    assert cell.tick(5).twist.linear == pytest.approx(0.3)
    put(cell, max_forward_velocity=1.2, max_forward_acc=0.5, smooth_level="disabled")
    assert cell.tick().twist.linear == pytest.approx(0.3 + 0.5 * 0.04)


@pytest.mark.parametrize(("level", "build_up"), [("lower", 0.12), ("normal", 0.2), ("higher", 0.4)])
def test_the_smooth_level_sets_in_which_time_an_acceleration_builds_up(
    level: SmoothLevel, build_up: float, cell: Cell
) -> None:
    put(cell, max_forward_acc=0.5, smooth_level=level)
    cell.create()
    speeds = [0.0, *(cell.tick().twist.linear for _ in range(12))]
    changes = [(b - a) / 0.04 for a, b in pairwise(speeds) if b > 0.0]
    assert changes[0] == pytest.approx(0.5 * 0.04 / build_up)
    assert changes.index(pytest.approx(0.5)) == round(build_up / 0.04) - 1


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


def test_parameters_outlast_a_restart_and_the_defaults_are_reported_beside(make_cell: Callable[..., Cell]) -> None:
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


def test_remote_driving_has_a_velocity_of_its_own(cell: Cell) -> None:
    cell.ask(SetControlMode(control_mode="remote"))
    put(cell, remote_max_forward_velocity=0.2)
    for _ in range(60):
        cell.ask(remote(5.0))
        cell.tick()
    assert cell.twist.linear == pytest.approx(0.2)


def test_a_load_slows_a_running_move_and_setting_it_down_does_not_outlast_it(cell: Cell) -> None:
    """The script wants 0.5 m/s; 240 kg of 300 allow 0.4."""
    cell.jack = Jack(stamp=0, state="hold", progress=1.0, weight=240.0)
    cell.create()
    assert cell.tick(20).twist.linear == pytest.approx(0.4)
    cell.jack = cell.jack.model_copy(update={"weight": 241.0})
    put(cell, weight_based_speed_limit=False)
    assert cell.tick(20).twist.linear == pytest.approx(0.5)
    put(cell, weight_based_speed_limit=True)
    assert cell.tick(20).twist.linear == pytest.approx(0.4)
    cell.jack = cell.jack.model_copy(update={"progress": 0.0, "weight": 0.0})
    assert cell.tick(20).twist.linear == pytest.approx(0.5)


KINDS = (RackSpec(width=0.765, depth=0.765, margin=(0.0925,) * 4), RackSpec(width=0.64, depth=0.7, leg_shape="round"))


def test_kinds_of_racks_are_in_force_at_once_and_outlast_a_restart_and_a_new_model(
    make_cell: Callable[..., Cell],
) -> None:
    first = make_cell()
    defaults_before = get(first).defaults.rack_specs
    assert first.motion.settings.rack_specs == defaults_before == NavigationSettings().rack_specs
    put(first, rack_specs=KINDS)
    assert first.motion.settings.rack_specs == KINDS
    first.chassis.on_message(chassis_model(wheel_radius=0.1))
    assert first.motion.settings.rack_specs == KINDS
    first.database.close()
    second = make_cell(path=first.path)
    assert second.motion.settings.rack_specs == get(second).values.rack_specs == KINDS
    assert get(second).defaults.rack_specs == defaults_before


def test_a_rack_lifted_unmeasured_counts_as_the_largest_of_the_kinds(cell: Cell) -> None:
    put(cell, rack_specs=KINDS)
    largest = cell.motion.settings.unmeasured_rack
    assert (largest.width, largest.depth, largest.margin) == (0.765, 0.765, (0.0925,) * 4)


def test_the_expanded_footprint_follows_its_setting(cell: Cell) -> None:
    cell.tick()
    put(cell, footprint_expansion=0.05)
    cell.tick()
    plain, larger = cell.heard(topics.FOOTPRINT)
    assert plain.expanded == pytest.approx(plain.outline)
    assert larger.outline == pytest.approx(plain.outline)
    assert np.abs(larger.expanded) == pytest.approx(np.abs(plain.outline) + 0.05)


def effects(cell: Cell) -> dict[str, Any]:
    """What the settings do to a chassis, unloaded and with 270 of 300 kg: what it drives with, reports and refuses."""
    cell.tick()
    unloaded = repr(cell.motion.settings)
    cell.jack = Jack(stamp=0, state="hold", progress=1.0, weight=270.0)
    cell.tick()
    seen = {
        "moves": (unloaded, repr(cell.motion.settings)),
        "remote": cell.chassis._remote_limits(),
        "footprint": cell.heard(topics.FOOTPRINT)[-1].expanded.tolist(),
    }
    cell.jack = Jack(stamp=0, state="jacking_down", progress=0.5, weight=270.0)
    cell.tick()
    try:
        seen["jacking"] = cell.create().state
    except RequestRefused as refused:
        seen["jacking"] = refused.code
    return seen


OTHER_VALUES: dict[str, Any] = {
    "smooth_level": "higher",
    "rack_specs": KINDS,
    "max_backward_velocity": -0.1,
    "max_forward_decel": -1.0,
}


def another(value: float | bool) -> float | bool:
    return not value if isinstance(value, bool) else max(0.5 * value, 0.05)


@pytest.mark.parametrize("row", SETTINGS, ids=lambda row: row.name)
def test_every_setting_acts_or_says_that_it_does_not(make_cell: Callable[..., Cell], row: Setting) -> None:
    untouched, changed = make_cell(), make_cell()
    default = getattr(get(changed).defaults, row.field)
    other = OTHER_VALUES[row.field] if row.field in OTHER_VALUES else another(default)
    assert getattr(put(changed, **{row.field: other}), row.field) == other != default
    acts = effects(changed) != effects(untouched)
    assert acts == (not row.description.startswith(NO_EFFECT))


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
