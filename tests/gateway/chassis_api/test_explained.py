"""``GET /chassis/moves/{id}/explain``: the evidence of a move as JSON."""

from __future__ import annotations

import base64
import io

import numpy as np
import pytest
from PIL import Image

from rackhand.bus import Unavailable
from tests.gateway.harness import Gateway


@pytest.fixture
def move_id(gateway: Gateway) -> int:
    moves = gateway.http.post("/chassis/moves", json={"type": "standard", "target_x": 1.0, "target_y": 2.0})
    number = int(moves.json()["id"])
    gateway.bus.end(number, state="failed", fail_reason=15, fail_message="blocked")
    return number


def test_a_failed_move_says_why_where_and_by_how_much(gateway: Gateway, move_id: int) -> None:
    found = gateway.http.get(f"/chassis/moves/{move_id}/explain").json()
    assert (found["id"], found["state"], found["verdict"]) == (move_id, "failed", "failed")
    assert "virtual wall" in found["cause"] and found["advice"]
    (thing,) = found["things"]
    assert (thing["kind"], thing["name"], thing["pos"]) == ("virtual wall", "north", [3.0, 1.5])
    assert (thing["clearance"], thing["needed"], thing["at"]) == (-0.05, 0.05, {"pos": [2.5, 1.5], "ori": 0.0})
    assert found["measures"] == [{"name": "time", "value": 15.1, "expected": 15.0, "unit": "s", "setting": ""}]
    assert found["held"] == [{"by": "an obstacle", "seconds": 15.0, "setting": ""}]
    assert found["trace"][0] == {
        "t": -0.04,
        "pos": [1.99, 1.5],
        "ori": 0.0,
        "velocity": [0.5, 0.0],
        "command": [0.4, 0.1],
    }
    assert found["paths"] == [{"t": -5.0, "positions": [[2.0, 1.5, 0.0], [4.0, 1.5, 0.0]]}]


def test_the_cut_out_of_the_costmap_is_a_picture_with_its_place(gateway: Gateway, move_id: int) -> None:
    costmap = gateway.http.get(f"/chassis/moves/{move_id}/explain").json()["costmap"]
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(costmap["data"]))))
    assert (costmap["origin"], costmap["resolution"], costmap["size"]) == ([1.0, 0.5], 0.05, [3, 2])
    assert pixels.tolist() == [[3, 4, 5], [0, 1, 2]], "row 0 is the top"


def test_the_evidence_can_be_downloaded_as_a_file(gateway: Gateway, move_id: int) -> None:
    found = gateway.http.get(f"/chassis/moves/{move_id}/explain").json()
    assert found["download_url"] == f"{gateway.url}/chassis/moves/{move_id}/explain/download"
    answer = gateway.http.get(found["download_url"])
    assert answer.json() == found
    assert answer.headers["content-disposition"] == f'attachment; filename="move_{move_id}.json"'


def test_the_viewer_makes_a_recording_of_the_evidence(gateway: Gateway, move_id: int) -> None:
    gateway.bus.recording = b"RRF2 and more"
    found = gateway.http.get(f"/chassis/moves/{move_id}/explain").json()
    assert found["recording_url"] == f"{gateway.url}/chassis/moves/{move_id}/explain/download.rrd"
    answer = gateway.http.get(found["recording_url"])
    assert (answer.status_code, answer.content) == (200, b"RRF2 and more")
    assert answer.headers["content-type"] == "application/octet-stream"
    assert answer.headers["content-disposition"] == f'attachment; filename="move_{move_id}.rrd"'
    (asked,) = gateway.bus.recorded
    assert (asked.robot, asked.explanation.move.id, asked.explanation.cause) == ("amr1", move_id, found["cause"])


def test_without_a_viewer_the_answer_says_how_to_start_one(gateway: Gateway, move_id: int) -> None:
    answer = gateway.http.get(f"/chassis/moves/{move_id}/explain/download.rrd")
    assert answer.status_code == 503
    assert "python -m rackhand.services.viewer" in answer.json()["detail"]


def test_without_a_planner_the_answer_does_not_blame_the_viewer(gateway: Gateway, move_id: int) -> None:
    gateway.bus.failure = Unavailable("no service answers moves/explain of amr1")
    answer = gateway.http.get(f"/chassis/moves/{move_id}/explain/download.rrd")
    assert (answer.status_code, answer.json()["detail"]) == (503, "no service answers moves/explain of amr1")


@pytest.mark.parametrize(
    "path",
    ["/chassis/moves/999/explain", "/chassis/moves/x/explain", "/chassis/moves/999/explain/download.rrd"],
)
def test_an_unknown_move_is_not_found(gateway: Gateway, path: str) -> None:
    assert gateway.http.get(path).status_code == 404
