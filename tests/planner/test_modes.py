"""Control modes, the two emergency stops, remote driving, the jack."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from pydantic import ValidationError

from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Pose2, Twist2
from rackhand.schemas.chassis import (
    Battery,
    FollowTarget,
    Jack,
    JackRequest,
    RemoteTwist,
    SetControlMode,
    SetEmergencyStop,
    SetPose,
)
from rackhand.schemas.refusal import RequestRefused
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.jacking import TIME_LIMIT_NS
from rackhand.services.planner.moves.records import RESTARTED
from tests.planner.fakes import FORWARD, STEP, Cell, Script


def remote(linear: float, angular: float = 0.0) -> RemoteTwist:
    return RemoteTwist(twist=Twist2(linear=linear, angular=angular))


@pytest.mark.parametrize("button", [False, True])
def test_an_emergency_stop_holds_the_move_until_it_is_released(cell: Cell, button: bool) -> None:
    def stop(on: bool) -> None:
        if button:
            cell.contacts["emergency_stop_button"] = on
        else:
            cell.ask(SetEmergencyStop(enable=on))

    move = cell.create()
    cell.tick(3)
    stop(True)
    assert 0 < cell.tick().twist.linear < FORWARD.linear
    assert cell.tick(20_000 // 40).twist == STANDSTILL
    assert cell.get(move.id).state == "moving"
    assert cell.heard(topics.CHASSIS_STATUS)[-1].emergency_stop is True
    assert len(cell.heard(topics.COSTMAP)) >= 20, "it goes on perceiving"
    assert cell.planning().message == "the emergency stop is on"
    stop(False)
    assert cell.tick().twist == FORWARD
    assert (len(cell.script.requests), cell.script.resumed) == (1, 1), "the same behaviour goes on"
    assert cell.planning().message == ""
    assert cell.events() == ["created"]


def test_a_paused_move_is_still_until_it_is_resumed(cell: Cell) -> None:
    move = cell.create()
    cell.tick(3)
    assert cell.pause().state == "moving", "the states of a move are those of the chassis API"
    assert cell.planning().paused
    assert 0 < cell.tick().twist.linear < FORWARD.linear
    assert cell.tick(600 * 25).twist == STANDSTILL, "however long it takes"
    state = cell.planning()
    assert (state.move_state, state.paused, state.message) == ("moving", True, "the move is paused on request")
    assert cell.pause().id == move.id, "asked for twice, it is so once"
    cell.pause(paused=False)
    assert not cell.planning().paused
    assert cell.tick().twist == FORWARD
    assert (len(cell.script.requests), cell.script.resumed) == (1, 1), "the same behaviour goes on"
    assert cell.events() == ["created", "paused", "resumed"]


def test_what_ends_a_paused_move(cell: Cell) -> None:
    """Cancelled, replaced, or the mode left: the next move is not paused."""

    def cancelled() -> None:
        cell.cancel()

    def remote_mode() -> None:
        cell.ask(SetControlMode(control_mode="remote"))
        cell.ask(SetControlMode(control_mode="auto"))

    for end in (cancelled, remote_mode, lambda: None):
        move = cell.create()
        cell.tick(3)
        cell.pause()
        cell.tick(30)
        end()
        following = cell.create()
        cell.tick(3)
        assert cell.get(move.id).state == "cancelled"
        assert (cell.get(following.id).state, cell.planning().paused) == ("moving", False)
        assert cell.tick().twist.linear > 0.0


def test_a_pause_ends_by_resuming_only(cell: Cell) -> None:
    """An emergency stop in between takes precedence in the message, and its release does not resume."""
    cell.create()
    cell.tick(3)
    cell.pause()
    cell.ask(SetEmergencyStop(enable=True))
    cell.tick(30)
    assert cell.planning().message == "the emergency stop is on"
    cell.ask(SetEmergencyStop(enable=False))
    assert cell.tick(30).twist == STANDSTILL
    cell.pause(paused=False)
    assert cell.tick(5).twist.linear > 0.0


def test_a_move_that_is_paused_before_its_first_tick_has_not_begun(cell: Cell) -> None:
    cell.create()
    cell.pause()
    cell.tick(10)
    assert cell.script.steps == 0
    cell.pause(paused=False)
    cell.tick()
    assert (cell.script.steps, cell.script.resumed) == (1, 0)


def test_a_restart_of_the_planner_ends_a_paused_move(make_cell: Callable[..., Cell]) -> None:
    """Nothing moves by itself afterwards, and the next move runs."""
    before = make_cell()
    move = before.create()
    before.tick(3)
    before.pause()
    before.tick(30)
    before.database.close()
    after = make_cell(path=before.path)
    after.tick(10)
    assert (after.get(move.id).state, after.get(move.id).fail_message) == ("failed", RESTARTED)
    assert (after.tick(10).twist, after.planning().paused) == (STANDSTILL, False)
    after.create()
    assert after.tick(5).twist.linear > 0.0


def test_a_target_is_taken_while_a_follow_target_move_runs(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(behaviors={"follow_target": Script()})
    target = FollowTarget(state="follow_pose", position=(2.0, 0.0))
    with pytest.raises(RequestRefused, match="no follow_target move is running"):
        cell.ask(target)
    cell.create()
    with pytest.raises(RequestRefused, match="no follow_target move is running"):
        cell.ask(target)
    move = cell.create(type="follow_target", target_x=None, target_y=None)
    cell.tick(2)
    cell.ask(target)
    cell.tick()
    assert cell.get(move.id).state == "moving"
    cell.cancel()
    with pytest.raises(RequestRefused, match="no follow_target move is running"):
        cell.ask(target)


def test_a_target_without_position_and_heading_is_malformed() -> None:
    with pytest.raises(ValidationError, match="needs a position, a heading, or both"):
        FollowTarget(state="follow_pose")


def test_pausing_what_does_not_run(cell: Cell) -> None:
    with pytest.raises(RequestRefused, match="no move is active"):
        cell.pause()
    move = cell.create()
    cell.cancel()
    with pytest.raises(RequestRefused, match=f"move {move.id} is cancelled and cannot be changed"):
        cell.pause(move_id=move.id)


def test_either_stop_holds(cell: Cell) -> None:
    cell.create()
    cell.contacts["emergency_stop_button"] = True
    cell.tick()
    cell.ask(SetEmergencyStop(enable=True))
    cell.contacts["emergency_stop_button"] = False
    assert cell.tick(20).twist == STANDSTILL
    cell.contacts["emergency_stop_button"] = True
    cell.tick()
    assert "button is still pressed" in cell.ask(SetEmergencyStop(enable=False)).detail
    assert cell.tick().twist == STANDSTILL


def test_a_move_asked_for_in_an_emergency_stop_waits_for_the_release(cell: Cell) -> None:
    cell.ask(SetEmergencyStop(enable=True))
    move = cell.create()
    cell.tick(50)
    assert (cell.get(move.id).state, cell.script.steps) == ("moving", 0)
    cell.ask(SetEmergencyStop(enable=False))
    assert cell.tick().twist == FORWARD


@pytest.mark.parametrize("mode", ["manual", "remote"])
def test_leaving_auto_cancels_the_move(cell: Cell, mode: str) -> None:
    move = cell.create()
    cell.tick()
    cell.ask(SetControlMode(control_mode=mode))
    text = f"the control mode was set to {mode}; moves run in auto"
    assert (cell.get(move.id).state, cell.get(move.id).fail_message) == ("cancelled", text)
    assert (cell.planning().move_state, cell.planning().message) == ("cancelled", text)
    assert cell.tick(20).twist == STANDSTILL
    assert cell.heard(topics.CHASSIS_STATUS)[-1].control_mode == mode


@pytest.mark.parametrize("mode", ["manual", "remote"])
def test_outside_auto_a_move_is_accepted_and_cancelled_with_the_reason(cell: Cell, mode: str) -> None:
    cell.ask(SetControlMode(control_mode=mode))
    move = cell.create()
    assert move.state == "moving"
    assert cell.tick().twist == STANDSTILL
    text = f"moves run in control mode auto, not {mode}"
    ended = cell.get(move.id)
    assert (ended.state, ended.fail_reason, ended.fail_message) == ("cancelled", 0, text)
    assert cell.planning().message == cell.heard(topics.MOVE_EVENT)[-1].text == text


def test_only_a_change_of_the_mode_is_a_reason_of_its_own(cell: Cell) -> None:
    cell.ask(SetControlMode(control_mode="remote"))
    move = cell.create()
    cell.ask(SetEmergencyStop(enable=False))
    assert cell.get(move.id).state == "moving"
    cell.tick()
    assert cell.get(move.id).fail_message == "moves run in control mode auto, not remote"


def test_remote_driving_is_limited_and_dies(cell: Cell) -> None:
    cell.ask(SetControlMode(control_mode="remote"))
    cell.ask(remote(5.0, -9.0))
    commands = [cell.tick().twist for _ in range(12)]  # 480 ms
    assert commands[0].linear == pytest.approx(0.5 * 0.04 * 0.04 / 0.2), "the acceleration builds up in 0.2 s"
    assert max(np.diff([c.linear for c in commands])) == pytest.approx(0.5 * 0.04)
    assert [c.linear for c in commands] == sorted(c.linear for c in commands)
    assert min(c.angular for c in commands) == pytest.approx(-12 * 1.5 * 0.04), "the tighter of both limits"
    after = [cell.tick().twist for _ in range(12)]
    assert after[0].linear < commands[-1].linear
    assert after[-1] == STANDSTILL


def test_remote_driving_goes_on_while_it_is_repeated(cell: Cell) -> None:
    cell.ask(SetControlMode(control_mode="remote"))
    for _ in range(60):
        cell.ask(remote(5.0))
        cell.tick()
    assert cell.twist.linear == pytest.approx(0.8)
    for _ in range(60):
        cell.ask(remote(-5.0))
        cell.tick()
    assert cell.twist.linear == pytest.approx(-0.2)


def test_a_remote_twist_is_refused_with_its_reason(cell: Cell) -> None:
    with pytest.raises(RequestRefused, match="the control mode is auto; remote driving needs mode remote"):
        cell.ask(remote(0.1))
    cell.ask(SetControlMode(control_mode="remote"))
    cell.ask(SetEmergencyStop(enable=True))
    with pytest.raises(RequestRefused, match="emergency stop is on"):
        cell.ask(remote(0.1))
    cell.ask(SetEmergencyStop(enable=False))
    cell.contacts["power_cable"] = True
    cell.tick()
    with pytest.raises(RequestRefused, match="power cable") as refused:
        cell.ask(remote(0.1))
    assert refused.value.code == "precondition"


def test_an_emergency_stop_forgets_the_remote_twist(cell: Cell) -> None:
    cell.ask(SetControlMode(control_mode="remote"))
    cell.ask(remote(0.5))
    cell.tick(3)
    cell.ask(SetEmergencyStop(enable=True))
    cell.tick()
    cell.ask(SetEmergencyStop(enable=False))
    assert cell.tick(3).twist == STANDSTILL


def test_a_remote_twist_does_not_outlive_a_reset_of_time(cell: Cell) -> None:
    cell.ask(SetControlMode(control_mode="remote"))
    cell.tick(3)
    cell.ask(remote(0.5))
    cell.chassis.reset("reset")
    assert cell.tick(3).twist == STANDSTILL, "though by its stamp it would live"


def test_the_jack_goes_until_it_has_arrived(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(jack=Jack(stamp=0, state="hold", progress=0.0, weight=0.0))
    assert cell.tick().jack == "hold"
    assert cell.ask(JackRequest(direction="up")).detail == "the jack moves up, from 0%"
    for progress in (0.0, 0.3, 0.9995):
        cell.jack = Jack(stamp=0, state="jacking_up", progress=progress, weight=0.0)
        assert cell.tick().jack == ("up" if progress < 0.9 else "hold")
    cell.jack = Jack(stamp=0, state="hold", progress=1.0, weight=0.0)
    cell.tick()
    assert cell.ask(JackRequest(direction="up")).detail == "the jack is already up"
    cell.ask(JackRequest(direction="down"))
    assert cell.tick().jack == "down"
    cell.ask(SetEmergencyStop(enable=True))
    assert cell.tick().jack == "hold"
    cell.ask(SetEmergencyStop(enable=False))
    assert cell.tick().jack == "down"


def test_the_jack_waits_for_standstill(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(jack=Jack(stamp=0, state="hold", progress=0.0, weight=0.0))
    cell.create()
    cell.tick(3)
    cell.cancel()
    cell.ask(JackRequest(direction="up"))
    assert cell.tick().jack == "hold"
    assert cell.tick(20).jack == "up"


def test_a_jack_that_does_not_arrive_is_reported(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(jack=Jack(stamp=0, state="hold", progress=0.2, weight=0.0))
    cell.ask(JackRequest(direction="up"))
    assert cell.tick(2).jack == "up"
    assert cell.tick(TIME_LIMIT_NS // STEP + 1).jack == "hold"
    assert [a.code for a in cell.heard(topics.CHASSIS_STATUS)[-1].alerts] == [9016]
    assert cell.create().state == "moving"


def test_no_jack_no_jacking(cell: Cell) -> None:
    with pytest.raises(RequestRefused, match="reports no jack"):
        cell.ask(JackRequest(direction="up"))


@pytest.mark.parametrize(
    ("percentage", "charging", "codes"),
    [(0.5, False, []), (0.19, False, [8501]), (0.09, False, [8003]), (0.09, True, [])],
)
def test_battery_alerts(cell: Cell, percentage: float, charging: bool, codes: list[int]) -> None:
    cell.chassis.on_message(Battery(stamp=0, percentage=percentage, voltage=24.0, current=1.0, charging=charging))
    cell.tick()
    alerts = cell.heard(topics.CHASSIS_STATUS)[-1].alerts
    assert [alert.code for alert in alerts] == codes
    assert [alert.level for alert in alerts] == ["error" if code == 8003 else "warning" for code in codes]


def test_a_pose_is_a_hint_the_localiser_does_not_need(cell: Cell) -> None:
    assert "not needed" in cell.ask(SetPose(pose=Pose2(x=0.0, y=0.0, yaw=0.0))).detail
    cell.pose_alive = False
    cell.stamp += NANOSECONDS
    cell.tick()
    with pytest.raises(RequestRefused, match="no localiser"):
        cell.ask(SetPose(pose=Pose2(x=0.0, y=0.0, yaw=0.0)))


def test_standing_still_is_commanded_too(cell: Cell) -> None:
    command = cell.tick()
    assert (command.twist, command.answers, command.jack) == (STANDSTILL, cell.stamp, "hold")


def test_remote_driving_at_a_wall_is_stopped_by_the_guard(cell: Cell) -> None:
    cell.ask(SetControlMode(control_mode="remote"))
    cell.ask(remote(0.5))
    assert cell.tick(5).twist.linear > 0.05
    cell.reach = 0.38  # all around, measured from the origin: 5 mm ahead of the body
    for _ in range(20):
        cell.ask(remote(0.5))
        cell.tick()
    assert cell.tick().twist == STANDSTILL
    cell.scan_alive = False
    cell.reach = 9.0
    for _ in range(60):
        cell.ask(remote(0.5))
        cell.tick()
    assert cell.twist == STANDSTILL, "without a scan nothing is known to be free"
