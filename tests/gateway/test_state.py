"""Messages in, changes out."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.schemas import topics
from rackhand.services.gateway.state import Change, RobotState
from tests.gateway import messages


def test_only_the_distance_is_a_stream_every_other_change_of_a_move_is_an_event() -> None:
    state = RobotState("amr1")
    assert state.on_message(topics.PLANNING_STATE, messages.planning()) == [Change("/planning_state", urgent=True)]
    nearer = messages.planning(stamp=5, remaining_distance=1.0)
    assert state.on_message(topics.PLANNING_STATE, nearer) == [Change("/planning_state")]
    for changes in ({"move_state": "succeeded"}, {"action_id": 8}, {"stuck_state": "move_stucked"}):
        changed = messages.planning(**changes)
        assert state.on_message(topics.PLANNING_STATE, changed) == [Change("/planning_state", urgent=True)]


def test_the_jack_streams_its_progress_and_its_state_is_an_event() -> None:
    state = RobotState("amr1")
    state.on_message(topics.JACK, messages.jack("hold"))
    assert state.on_message(topics.JACK, messages.jack("jacking_up", 0.1)) == [Change("/jack_state", urgent=True)]
    assert state.on_message(topics.JACK, messages.jack("jacking_up", 0.2)) == [Change("/jack_state")]


@pytest.mark.parametrize("pose_first", [True, False])
def test_a_scan_is_sent_with_the_pose_at_which_it_was_taken(pose_first: bool) -> None:
    state = RobotState("amr1")
    step: list[tuple[Any, Any]] = [
        (topics.POSE, messages.pose(stamp=80, x=1.0)),
        (topics.SCAN, messages.scan(stamp=80)),
    ]
    for topic, message in step if pose_first else reversed(step):
        last = state.on_message(topic, message)
    assert Change("/scan_matched_points2") in last
    assert Change("/scan_matched_points2") not in state.on_message(topics.POSE, messages.pose(stamp=120, x=9.0))
    assert state.facts.matched is not None
    assert state.facts.matched[1].x == 1.0


def test_a_scan_waits_for_its_pose() -> None:
    state = RobotState("amr1")
    state.on_message(topics.POSE, messages.pose(stamp=40))
    assert state.on_message(topics.SCAN, messages.scan(stamp=80)) == []
    assert state.payload("/scan_matched_points2") is None


def test_acceleration_is_the_slope_of_the_last_tenth_of_a_second_and_starts_over_with_the_clock() -> None:
    state = RobotState("amr1")
    for tick in range(20):
        state.on_message(topics.ODOMETRY, messages.odometry(stamp=tick * 20_000_000, linear=0.01 * tick))
    assert state.facts.acceleration == pytest.approx(0.5)
    state.on_message(topics.ODOMETRY, messages.odometry(stamp=0))
    assert state.facts.acceleration == 0.0


def test_a_pose_that_is_missing_for_a_second_changes_the_slam_state_once_and_so_does_the_next_pose() -> None:
    state = RobotState("amr1")
    state.on_message(topics.POSE, messages.pose())
    late = [messages.odometry(stamp=1_000_000_000 + late) for late in (0, 20_000_000, 40_000_000)]
    changed = [Change("/slam/state") in state.on_message(topics.ODOMETRY, message) for message in late]
    assert changed == [False, True, False]
    assert Change("/slam/state") in state.on_message(topics.POSE, messages.pose(stamp=1_060_000_000))
    assert state.facts.quality == 10
