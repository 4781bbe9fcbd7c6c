"""A move explained, as a recording: the file is read back."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np
import pytest
import rerun.blueprint as rrb

from rackhand.bus import Request
from rackhand.schemas.base import Pose2
from rackhand.schemas.explain import Evidence, Explanation, MoveRecording, RecordMove
from rackhand.schemas.refusal import RefusalCode
from rackhand.services.viewer import answers
from rackhand.services.viewer.blueprint import move_blueprint
from rackhand.services.viewer.explained import bounds, recorded, words
from rackhand.services.viewer.picture import RobotSet
from tests.gateway.explanations import explanation
from tests.viewer import reading

SECOND, MILLISECOND = 1_000_000_000, 1_000_000
END = 20 * SECOND


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recording") / "move.rrd"
    path.write_bytes(recorded("amr1", explanation()))
    return path


def test_the_trace_is_on_the_timeline_of_the_simulation(file: Path) -> None:
    poses = reading.poses(file)
    assert sorted(stamp for stamp, _ in poses) == pytest.approx([END - 40 * MILLISECOND, END], abs=1000)
    assert {frame for _, frame in poses} == {"amr1:localised"}
    assert reading.newest(file)["amr1:localised"][0] == pytest.approx((2.0, 1.5, 0.0))
    assert reading.end(file) == END


def test_velocity_and_command_are_curves_of_their_own(file: Path) -> None:
    for entity, values in {
        "speed/forward": [0.5, 0.4],
        "speed/turning": [0.0, 0.0],
        "speed/forward_wanted": [0.4, 0.3],
        "speed/turning_wanted": [0.1, 0.0],
    }.items():
        found = [value for [value] in reading.column(file, f"amr1/{entity}", "Scalars:scalars")]
        assert found == pytest.approx(values, abs=1e-6), entity


def test_the_costmap_lies_at_its_origin_with_its_first_row_below(file: Path) -> None:
    [[cells]] = reading.column(file, "amr1/costmap", "GridMap:data")
    [[place]] = reading.column(file, "amr1/costmap", "GridMap:translation")
    [[size]] = reading.column(file, "amr1/costmap", "GridMap:cell_size")
    assert bytes(cells) == bytes([3, 4, 5, 0, 1, 2])
    assert place[:2] == pytest.approx([1.0, 0.5]) and size == pytest.approx(0.05)
    assert reading.stamps(file, "amr1/costmap") == [END]


def test_a_path_is_drawn_when_it_was_planned(file: Path) -> None:
    [[strip]] = reading.column(file, "amr1/path", "LineStrips3D:strips")
    assert np.array(strip)[:, :2].tolist() == [[2.0, 1.5], [4.0, 1.5]]
    assert reading.stamps(file, "amr1/path") == [15 * SECOND]


def test_things_have_their_places_and_names(file: Path) -> None:
    [[place]] = reading.column(file, "amr1/things", "Points3D:positions")
    [[label]] = reading.column(file, "amr1/things", "Points3D:labels")
    assert place[:2] == [3.0, 1.5]
    assert label == "virtual wall 'north'"


def test_the_footprint_is_drawn_where_the_chassis_ended(file: Path) -> None:
    """In the frame of the chassis, at (2, 1.5): its corners in the map are those of the explanation."""
    [[strip]] = reading.column(file, "amr1/outline", "LineStrips3D:strips")
    assert np.array(strip)[:-1, :2] == pytest.approx(np.array([[0.3, -0.3], [0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3]]))


def test_a_footprint_of_a_turned_chassis_is_turned_back(tmp_path: Path) -> None:
    turned = explanation().model_copy(update={"pose": Pose2(x=2.0, y=1.5, yaw=np.pi / 2)})
    file = tmp_path / "move.rrd"
    file.write_bytes(recorded("amr1", turned))
    [[strip]] = reading.column(file, "amr1/outline", "LineStrips3D:strips")
    assert np.array(strip)[0, :2] == pytest.approx([-0.3, -0.3], abs=1e-6), "(0.3, -0.3) in the map"


def test_the_cause_is_text_and_a_line_of_the_log(file: Path) -> None:
    [[text]] = reading.column(file, "amr1/cause", "TextDocument:text")
    assert text == words(explanation())
    [[line]] = reading.column(file, "amr1/log", "TextLog:text")
    assert line.startswith("move 1 (standard) failed: path exists, no progress for 15 s")


def test_words_have_the_cause_the_advice_and_the_numbers() -> None:
    lines = words(explanation()).splitlines()
    assert lines[0] == "Move 1 (standard) failed: MoveTimeout. 20.0 s, 1.50 m driven."
    assert explanation().cause in lines
    assert "To do: remove what blocks the way, then post the move again" in lines
    assert "  virtual wall 'north' at (3.00, 1.50): clearance -0.05 m, needed 0.05 m" in lines
    assert "  time 15.1 s, expected 15 s" in lines
    assert "  an obstacle: 15.0 s" in lines


def test_the_camera_sees_all_that_is_drawn() -> None:
    low, high = bounds(explanation()) or pytest.fail("no bounds")
    assert low[:2] == pytest.approx((0.0, -0.5)) and high[:2] == pytest.approx((5.0, 2.8))


def bare() -> Explanation:
    """Of a move long ago: the record alone."""
    none = {"evidence": Evidence(), "pose": None, "paths": (), "costmap": None, "held": (), "advice": ""}
    empty = {"trace": np.empty((0, 8), "<f4"), "footprint": np.empty((0, 2), "<f4")}
    return explanation().model_copy(update={**none, **empty})


def test_an_explanation_without_evidence_is_a_recording_of_its_words(tmp_path: Path) -> None:
    assert bounds(bare()) is None
    file = tmp_path / "move.rrd"
    file.write_bytes(recorded("amr1", bare()))
    assert reading.column(file, "amr1/cause", "TextDocument:text") == [[words(bare())]]
    assert reading.poses(file) == {} and "amr1/costmap" not in reading.entities(file)


def test_a_pose_is_kept_where_there_is_no_trace(tmp_path: Path) -> None:
    file = tmp_path / "move.rrd"
    file.write_bytes(recorded("amr1", bare().model_copy(update={"pose": Pose2(x=4.0, y=2.0, yaw=0.0)})))
    assert reading.newest(file)["amr1:localised"][0] == pytest.approx((4.0, 2.0, 0.0))


def test_a_recording_has_a_layout_with_its_words_beside_the_place() -> None:
    root = move_blueprint(RobotSet(chassis=("amr1",))).root_container
    assert len(root.contents) == 2
    assert isinstance(root.contents[1], rrb.Vertical)
    assert isinstance(root.contents[1].contents[0], rrb.TextDocumentView)


class FakeRequest:
    def __init__(self, message: RecordMove) -> None:
        self.message = message
        self.replies: list[MoveRecording] = []
        self.refusals: list[tuple[RefusalCode, str]] = []

    def reply(self, message: MoveRecording) -> None:
        self.replies.append(message)

    def refuse(self, code: RefusalCode, text: str) -> None:
        self.refusals.append((code, text))


def answered(wanted: Explanation) -> FakeRequest:
    request = FakeRequest(RecordMove(robot="amr1", explanation=wanted))
    answers.answer(cast("Request[RecordMove, MoveRecording]", request))
    return request


def test_a_request_is_answered_with_the_file(tmp_path: Path) -> None:
    (reply,) = answered(explanation()).replies
    (tmp_path / "move.rrd").write_bytes(reply.data)
    assert "amr1/costmap" in reading.entities(tmp_path / "move.rrd")


def test_what_cannot_be_drawn_is_refused_by_the_number_of_the_move() -> None:
    unknown = explanation().move.model_copy(update={"fail_reason": 123456})
    request = answered(explanation().model_copy(update={"move": unknown}))
    assert not request.replies
    ((code, text),) = request.refusals
    assert code is RefusalCode.INTERNAL and text.startswith("the recording of move 1 could not be made: ")
