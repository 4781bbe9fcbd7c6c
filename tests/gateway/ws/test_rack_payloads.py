"""Frames about racks, as the chassis API's documentation shows them."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.racks import LoadReport
from rackhand.schemas.websocket import WsTopic
from rackhand.services.gateway.ws import rack_payloads
from rackhand.services.gateway.ws.facts import Facts
from tests.gateway import messages


def fields(frame: WsTopic | None) -> dict[str, Any]:
    assert frame is not None
    return frame.model_dump(mode="json", exclude_unset=True)


def test_a_detected_rack_has_its_depth_as_height() -> None:
    box = {"pose": {"pos": [4.0, 2.4], "ori": 0.02}, "width": 0.91, "height": 1.19}
    assert fields(rack_payloads.detected_rack(Facts({topics.DETECTED_RACK: messages.detected_rack()}))) == {
        "rack_detected": True,
        "frame": "map",
        "rack_box": box,
        "rack_box_aligned": box,
    }


def test_a_search_without_a_result_has_no_box() -> None:
    facts = Facts({topics.DETECTED_RACK: messages.detected_rack(detected=False)})
    assert fields(rack_payloads.detected_rack(facts)) == {"rack_detected": False}


@pytest.mark.parametrize(
    ("topic", "make"),
    [
        (topics.DETECTED_RACK_STATES, rack_payloads.detected_rack_states),
        (topics.MAP_RACK_STATES, rack_payloads.map_rack_states),
    ],
)
def test_rack_states_have_unix_nanoseconds(topic: Any, make: Any) -> None:
    facts = Facts({topic: messages.rack_states("free", stamp=250), topics.CLOCK: messages.clock(1)})
    assert fields(make(facts)) == {
        "map_uid": "hall",
        "racks": [
            {"poi_id": "storage-1", "levels": [{"timestamp_ns": 1_000_000_250, "level": 0, "state": "free"}]},
        ],
    }


def test_a_carried_rack_moves_with_the_robot() -> None:
    """The robot faces +y at (1, 2), the rack is 0.5 m before it and turned to the left of it, so it faces -x."""
    facts = Facts({topics.LOAD: messages.load(), topics.POSE: messages.pose(x=1.0, y=2.0, yaw=math.pi / 2)})
    frame = fields(rack_payloads.load_state(facts))
    assert frame["state"] == "carrying"
    assert frame["rack"]["pose"] == {"pos": [1.0, 2.5], "ori": pytest.approx(math.pi, abs=1e-4)}
    assert (frame["rack"]["width"], frame["rack"]["depth"]) == (0.9, 1.2)
    # 0.6 m and a margin of 0.1 m ahead, which is -x; 0.45 m and 0.05 m to the left, which is -y.
    assert frame["rack"]["outline"][0] == pytest.approx([1.0 - 0.7, 2.5 - 0.5])
    facts.add(topics.POSE, messages.pose(x=4.0, y=2.0, yaw=math.pi / 2))
    assert fields(rack_payloads.load_state(facts))["rack"]["pose"]["pos"] == [4.0, 2.5]


def test_a_rack_on_the_floor_stays_where_it_is() -> None:
    facts = Facts(
        {topics.LOAD: messages.load("under_rack", Pose2(x=7.0, y=3.0, yaw=0.1)), topics.POSE: messages.pose()}
    )
    assert fields(rack_payloads.load_state(facts))["rack"]["pose"] == {"pos": [7.0, 3.0], "ori": 0.1}


def test_no_place_is_given_for_a_rack_that_is_not_there_or_not_known() -> None:
    assert fields(rack_payloads.load_state(Facts({topics.LOAD: LoadReport(stamp=0)}))) == {"state": "free"}
    assert fields(rack_payloads.load_state(Facts({topics.LOAD: messages.load()}))) == {"state": "carrying"}
    assert rack_payloads.load_state(Facts()) is None


def test_racks_that_were_seen_have_their_outlines_in_the_map() -> None:
    facts = Facts({topics.SEEN_RACKS: messages.seen_racks(Pose2(x=7.0, y=3.0, yaw=0.0))})
    (rack,) = fields(rack_payloads.seen_racks(facts))["racks"]
    assert (rack["pose"], rack["width"], rack["depth"]) == ({"pos": [7.0, 3.0], "ori": 0.0}, 0.9, 1.2)
    assert rack["outline"] == [[7.7, 3.5], [6.2, 3.5], [6.2, 2.5], [7.7, 2.5]]  # margins of 0.1 and 0.2 m
