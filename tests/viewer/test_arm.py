"""What an arm's messages become."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.schemas.motion import ArmModel, ControlInfo, Gripper, Holder, MotionEvent, MotionPath
from rackhand.services.viewer.arm import ArmView
from rackhand.services.viewer.blueprint import blueprint, shown
from rackhand.services.viewer.geometry import EMPTY_HALL
from rackhand.services.viewer.items import Drawing, Note, Pose, Row
from rackhand.services.viewer.picture import RobotSet
from tests.viewer.test_service import UPRIGHT, arm_status, diagnostics


@pytest.fixture
def view() -> ArmView:
    return ArmView("arm1")


def notes(items: object) -> list[tuple[str, str]]:
    return [(item.level, item.text) for item in items if isinstance(item, Note)]  # type: ignore[attr-defined]


def test_frames_are_relative_to_the_mount_of_the_arm(view: ArmView) -> None:
    (mount,) = view.model(ArmModel(kind="ur5e", position=(3.0, 1.0, 0.6), orientation=UPRIGHT))
    assert isinstance(mount, Pose) and (mount.frame, mount.parent) == ("arm1:mount", "map")
    tool = next(item for item in view.status(arm_status(0)) if isinstance(item, Pose))
    assert (tool.frame, tool.parent, tool.position) == ("arm1:tool", "arm1:mount", (0.4, 0.0, 0.5))
    assert view.mount.position == (3.0, 1.0, 0.6) and view.mount.tool == (0.4, 0.0, 0.5)


def test_errors_are_in_millimetres_and_durations_as_reported(view: ArmView) -> None:
    rows = {item.entity: item.values for item in view.diagnostics(diagnostics(0)) if isinstance(item, Row)}
    assert rows["arm1/error/linear"] == pytest.approx((10.0,))
    assert rows["arm1/loop/tick"] == (200.0,) and rows["arm1/loop/solver"] == (50.0,)
    assert rows["arm1/counts/iterations"] == (3.0,) and rows["arm1/counts/late_ticks"] == (1.0,)


def test_a_path_is_drawn_in_the_base_frame_with_its_ends(view: ArmView) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]], dtype=np.float32)
    way, ends = view.path(MotionPath(stamp=0, points=points, ends=(1, 2, 9)))
    assert isinstance(way, Drawing) and isinstance(ends, Drawing)
    assert way.frame == ends.frame == "arm1:mount" and way.lasting
    assert ends.parts[0].positions.as_arrow_array().to_pylist() == [[1, 0, 0], [1, 1, 0]], (
        "an end beyond the path is none"
    )


def test_the_log_tells_who_holds_control_and_who_stopped(view: ArmView) -> None:
    holder = Holder(client="teach pendant", priority=5, lease_id=1, lease_age=0.0)
    held = arm_status(0).model_copy(update={"holder": holder})
    assert ("INFO", "locked by teach pendant at priority 5") in notes(view.status(held))
    assert notes(view.status(held)) == []
    assert ("INFO", "unlocked") in notes(view.status(arm_status(0)))
    pumping = arm_status(0).model_copy(update={"gripper": Gripper(suction=True, holding=True)})
    assert notes(view.status(pumping)) == [("INFO", "suction on, holding an object")]
    assert notes(view.status(arm_status(0))) == [("INFO", "suction off")]
    stopped = arm_status(0).model_copy(update={"stopped_by": "x" * 40})
    assert notes(view.status(stopped)) == [("ERROR", f"stopped by {'x' * 12}…")]
    info = ControlInfo(client="a", priority=3, lease_id=1, epoch="e", by="b", reason="preempted")
    event = MotionEvent(stamp=0, name="controlLost", info=info)
    assert notes(view.event(event)) == [("WARN", "control lost by a (priority 3): preempted by b")]


def test_the_layout_has_a_tab_for_whom_there_is() -> None:
    everything = RobotSet(("amr1",), ("arm1",), (ArmView("arm1").mount,), EMPTY_HALL)
    for cast in (everything, RobotSet(), RobotSet(chassis=("amr1", "amr2"))):
        assert blueprint(cast).root_container.contents
    assert {"amr1/scan", "arm1/path", "scene", "tf", "bus/log"} <= set(shown(everything))
    assert not [entity for entity in shown(RobotSet(chassis=("amr1",))) if entity.startswith("arm")]
