"""Events in, changes out."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.bus import Presence, Sample
from rackhand.schemas import topics
from rackhand.schemas.service import ServiceId
from rackhand.services.gateway.state import Change, State
from tests.gateway import messages

PLANNER = ServiceId("planner", "amr1")


def heard(state: State, topic: topics.Topic[Any], message: Any) -> list[Change]:
    return state.on_message(Sample(topic, "amr1", message), 0.0)


def test_only_the_distance_is_a_stream_every_other_change_of_a_move_is_an_event() -> None:
    state = State("amr1")
    assert heard(state, topics.PLANNING_STATE, messages.planning()) == [Change("/planning_state", urgent=True)]
    nearer = messages.planning(stamp=5, remaining_distance=1.0)
    assert heard(state, topics.PLANNING_STATE, nearer) == [Change("/planning_state")]
    for changes in ({"move_state": "succeeded"}, {"action_id": 8}, {"stuck_state": "move_stucked"}):
        changed = messages.planning(**changes)
        assert heard(state, topics.PLANNING_STATE, changed) == [Change("/planning_state", urgent=True)]


def test_the_jack_streams_its_progress_and_tells_its_state_at_once() -> None:
    state = State("amr1")
    heard(state, topics.JACK, messages.jack("hold"))
    assert heard(state, topics.JACK, messages.jack("jacking_up", 0.1)) == [Change("/jack_state", urgent=True)]
    assert heard(state, topics.JACK, messages.jack("jacking_up", 0.2)) == [Change("/jack_state")]


@pytest.mark.parametrize("pose_first", [True, False])
def test_a_scan_is_told_with_the_pose_of_its_own_instant(pose_first: bool) -> None:
    state = State("amr1")
    instant = [(topics.POSE, messages.pose(stamp=80, x=1.0)), (topics.SCAN, messages.scan(stamp=80))]
    for topic, message in instant if pose_first else reversed(instant):
        last = heard(state, topic, message)
    assert Change("/scan_matched_points2") in last
    assert Change("/scan_matched_points2") not in heard(state, topics.POSE, messages.pose(stamp=120, x=9.0))
    assert state.facts.scan_pose is not None
    assert state.facts.scan_pose.x == 1.0


def test_a_scan_without_a_pose_of_its_instant_is_not_told() -> None:
    state = State("amr1")
    heard(state, topics.POSE, messages.pose(stamp=40))
    assert heard(state, topics.SCAN, messages.scan(stamp=80)) == []
    assert state.payload("/scan_matched_points2") is None


def test_acceleration_is_the_slope_of_the_last_tenth_of_a_second_and_survives_a_new_beginning() -> None:
    state = State("amr1")
    for tick in range(20):
        heard(state, topics.ODOMETRY, messages.odometry(stamp=tick * 20_000_000, linear=0.01 * tick))
    assert state.facts.acceleration == pytest.approx(0.5)
    heard(state, topics.ODOMETRY, messages.odometry(stamp=0))
    assert state.facts.acceleration == 0.0


def test_a_pose_that_stays_out_is_told_once_and_so_is_its_return() -> None:
    state = State("amr1")
    heard(state, topics.POSE, messages.pose())
    late = [messages.odometry(stamp=1_000_000_000 + late) for late in (0, 20_000_000, 40_000_000)]
    told = [Change("/slam/state") in heard(state, topics.ODOMETRY, message) for message in late]
    assert told == [False, True, False]
    assert Change("/slam/state") in heard(state, topics.POSE, messages.pose(stamp=1_060_000_000))
    assert state.facts.quality == 10


def test_services_come_go_and_come_back() -> None:
    state = State("amr1", [PLANNER])
    assert not state.all_up
    for alive, now in ((True, 10.0), (True, 11.0), (False, 12.0), (True, 13.0)):
        assert state.on_message(Presence(PLANNER, alive), now) == []
    known = state.services[PLANNER]
    assert (state.all_up, known.alive, known.since, known.restarts) == (True, True, 13.0, 1)
    state.on_message(Presence(PLANNER, False), 14.0)
    assert (state.all_up, known.since, known.restarts) == (False, 14.0, 1)
