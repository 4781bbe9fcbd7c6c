"""The viewer between a bus of the test's own and recordings on disk."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
import rerun as rr

from rackhand.bus import Bus, Event, Presence, Sample
from rackhand.schemas import topics
from rackhand.schemas.motion import ArmModel, MotionDiagnostics, MotionPath, MotionStatus
from rackhand.schemas.service import BusStats, ServiceId
from rackhand.schemas.world import Clock, ObjectPose, Objects, Scene, SceneGeom
from rackhand.services.viewer.recording import Recording
from rackhand.services.viewer.service import Viewer, next_frame, numbered
from tests.gateway import messages
from tests.viewer import reading

SECOND, MILLISECOND = 1_000_000_000, 1_000_000
UPRIGHT = (1.0, 0.0, 0.0, 0.0)


class FakeBus:
    """Its one inbox gives what the test has put there, and its streams have nothing to add."""

    def __init__(self) -> None:
        self.events: deque[Event] = deque()
        self.topics: list[str] = []
        self.stopping = False

    def inbox(self) -> FakeBus:
        return self

    def newest(self) -> FakeBus:
        return self

    def subscribe(self, topic: topics.Topic[Any], **_: Any) -> None:
        self.topics.append(topic.name)

    follow = subscribe

    def take(self) -> tuple[()]:
        return ()

    def watch_services(self) -> None: ...

    def get(self, **_: Any) -> Event | None:
        return self.events.popleft() if self.events else None


class Bench:
    """A viewer that draws what it is told, frame by frame, and the files it draws into."""

    def __init__(self, folder: Path) -> None:
        self._folder, self.runs, self._wall = folder, [], 100.0  # type: list[str]
        self.bus = FakeBus()
        self.viewer = Viewer(cast(Bus, self.bus), self._new, rate=25.0)

    def _new(self, run: str) -> Recording:
        self.runs.append(run)
        return Recording(run, [rr.FileSink(self.file(len(self.runs)))])

    def file(self, number: int) -> Path:
        return numbered(self._folder / "run.rrd", number)

    def tell(self, topic: topics.Topic[Any], robot: str, message: Any) -> None:
        self.bus.events.append(Sample(topic, robot, message))

    def clock(self, stamp: int, run: str = "one", **changes: Any) -> None:
        clock = messages.clock().model_copy(update={"stamp": stamp, "run": run, **changes})
        self.tell(topics.CLOCK, "world", Clock.model_validate(clock.model_dump()))

    def frame(self, after: float = 0.04) -> None:
        self._wall += after
        self.viewer.frame(self._wall)

    def end(self) -> None:
        self.bus.stopping = True
        self.viewer.run()


@pytest.fixture
def bench(tmp_path: Path) -> Bench:
    return Bench(tmp_path)


def crate(position: tuple[float, float, float], body: str = "crate") -> SceneGeom:
    return SceneGeom(
        body=body, shape="box", size=(0.2, 0.2, 0.2), position=position, orientation=UPRIGHT, rgba=np.ones(4)
    )


def arm_status(stamp: int) -> MotionStatus:
    joints = {"value": (0.1, 0.2), "code": 200, "detail": 0}
    none = {"value": (0.0,) * 6, "code": 200, "detail": 0}
    pose = {"Position": (0.4, 0.0, 0.5), "Orientation": {"Quaternion": {"W": 1.0, "X": 0.0, "Y": 0.0, "Z": 0.0}}}
    return MotionStatus.model_validate(
        {
            "status": "initialize",
            "priorityUnderControl": 0,
            "isTrajectoryRunning": {"value": True, "code": 200, "detail": 0},
            "controllerStatus": (),
            "jointPositions": joints,
            "jointVelocities": joints,
            "jointAccelerations": joints,
            "jointForceTorques": joints,
            "taskPose": {"value": pose, "code": 200, "detail": 0},
            "taskVelocity": none,
            "taskAcceleration": none,
            "taskForceTorque": none,
            "stamp": stamp,
        }
    )


def diagnostics(stamp: int) -> MotionDiagnostics:
    return MotionDiagnostics(
        stamp=stamp,
        target_position=(0.41, 0.0, 0.5),
        target_orientation=UPRIGHT,
        joint_errors=(0.001, 0.002),
        linear_error=0.01,
        angular_error=0.0,
        tick_us=200.0,
        solver_us=50.0,
        solver_iterations=3,
        late_ticks=1,
    )


def test_a_real_robot_is_drawn_without_a_world(bench: Bench) -> None:
    """No clock, no scene, no ground-truth poses: what the robots publish is enough."""
    bench.tell(topics.CHASSIS_MODEL, "amr1", messages.model())
    bench.tell(topics.FOOTPRINT, "amr1", messages.footprint())
    bench.tell(topics.LOAD, "amr1", messages.load())
    bench.tell(topics.DETECTED_RACK, "amr1", messages.detected_rack())
    bench.tell(topics.MAP_RACK_STATES, "amr1", messages.rack_states())
    bench.tell(topics.SEEN_RACKS, "amr1", messages.seen_racks())
    bench.tell(topics.LIFT_MODEL, "lift_1", messages.lift_model())
    bench.tell(topics.LIFT_STATE, "lift_1", messages.lift())
    bench.tell(topics.ARM_MODEL, "arm1", ArmModel(kind="ur5e", position=(3.0, 1.0, 0.6), orientation=UPRIGHT))
    way = np.array([[0.4, 0.0, 0.5], [0.4, 0.1, 0.5]], dtype=np.float32)
    for i in range(40):
        stamp = i * SECOND // 25
        bench.tell(topics.POSE, "amr1", messages.pose(stamp, x=0.1 * i, yaw=0.0))
        bench.tell(topics.SCAN, "amr1", messages.scan(stamp))
        bench.tell(topics.ODOMETRY, "amr1", messages.odometry(stamp, linear=0.5))
        bench.tell(topics.MOTION_STATUS, "arm1", arm_status(stamp))
        bench.tell(topics.MOTION_DIAGNOSTICS, "arm1", diagnostics(stamp))
        bench.tell(topics.MOTION_PATH, "arm1", MotionPath(stamp=stamp, points=way, ends=(1,)))
        bench.frame()
    bench.end()
    assert bench.runs == [""]
    found = reading.entities(bench.file(1))
    assert {"amr1/footprint", "amr1/scan", "amr1/trail", "amr1/speed/forward"} <= found
    assert {"amr1/outline", "amr1/rack/carried", "amr1/rack/legs", "amr1/rack/staging", "amr1/rack/points"} <= found
    assert {"lift_1/cabin", "lift_1/doors", "lift_1/state"} <= found
    assert {"arm1/path", "arm1/way_points", "arm1/joints/velocity", "arm1/error/linear", "arm1/frames/tool"} <= found
    poses = reading.newest(bench.file(1))
    assert poses["arm1:mount"][0] == pytest.approx((3.0, 1.0, 0.6))
    assert poses["arm1:tool"][0] == pytest.approx((0.4, 0.0, 0.5))
    assert poses["arm1:target"][0] == pytest.approx((0.41, 0.0, 0.5))
    assert poses["amr1:localised"][0] == pytest.approx((3.9, 2.0, 0.0))


def test_what_has_no_stamp_does_not_begin_a_recording(bench: Bench) -> None:
    """Services count what they hear before there is a world."""
    for _ in range(60):
        bench.tell(topics.BUS_STATS, "cell", BusStats(service="gateway", received=1, dropped=0, malformed=0))
        bench.frame()
    assert bench.runs == []


def test_a_new_run_is_another_recording_with_all_that_holds_for_ever(bench: Bench) -> None:
    bench.tell(topics.SCENE, "world", Scene(stamp=0, geoms=(crate((0.0, 0.0, 0.2)),)))
    bench.tell(topics.CHASSIS_MODEL, "amr1", messages.model())
    bench.clock(100 * SECOND, "one")
    bench.tell(topics.POSE, "amr1", messages.pose(100 * SECOND))
    bench.frame()
    bench.clock(0, "two")
    bench.tell(topics.POSE, "amr1", messages.pose(101 * SECOND, x=7.0))  # the former run's last words
    bench.frame()
    bench.end()
    assert bench.runs == ["one", "two"]
    assert (100 * SECOND, "amr1:localised") in reading.poses(bench.file(1))
    assert {"scene/crate/box", "amr1/footprint"} <= reading.entities(bench.file(2))
    assert not reading.poses(bench.file(2)), "nothing of the former run is in the new one's time"


def test_a_body_that_is_gone_is_drawn_as_nothing_and_what_stays_is_left_alone(bench: Bench) -> None:
    two = Scene(stamp=0, geoms=(crate((0, 0, 0)), crate((1, 0, 0), body="rack")))
    bench.clock(0)
    bench.tell(topics.SCENE, "world", two)
    bench.frame()
    bench.tell(topics.SCENE, "world", Scene(stamp=0, geoms=two.geoms[1:]))
    bench.frame()
    bench.end()
    sizes = {"scene/crate/box": [], "scene/rack/box": []}  # type: dict[str, list[int]]
    for chunk in reading.chunks(bench.file(1)):
        batch = chunk.to_record_batch()
        if "Boxes3D:half_sizes" in batch.schema.names:
            sizes[chunk.entity_path[1:]] += [len(row) for row in batch["Boxes3D:half_sizes"].to_pylist()]
    assert sizes == {"scene/crate/box": [1, 0], "scene/rack/box": [1]}


def test_what_lasts_is_drawn_again_for_those_who_come_late(bench: Bench) -> None:
    bench.clock(0)
    bench.tell(topics.PATH, "amr1", messages.path())
    bench.tell(
        topics.OBJECTS,
        "world",
        Objects(stamp=0, objects=(ObjectPose(name="crate", position=(1, 2, 3), orientation=UPRIGHT),)),
    )
    bench.frame()
    bench.clock(20 * SECOND)
    bench.frame(after=6.0)
    bench.clock(20 * SECOND, paused=True)
    bench.frame(after=6.0)  # time has not gone on: there is nothing to be forgotten
    bench.end()
    assert (20 * SECOND, "crate") in reading.poses(bench.file(1))
    assert reading.stamps(bench.file(1), "amr1/path") == [0, 20 * SECOND]


def test_of_a_drawing_that_changed_more_than_once_in_a_frame_the_last_is_drawn(bench: Bench) -> None:
    for stamp in (SECOND, SECOND + 200 * MILLISECOND, SECOND + 400 * MILLISECOND):
        bench.clock(stamp)
        bench.tell(topics.PATH, "amr1", messages.path(stamp))
    bench.frame()
    bench.end()
    assert reading.stamps(bench.file(1), "amr1/path") == [SECOND + 400 * MILLISECOND]


def test_services_that_come_and_go_are_reported(bench: Bench) -> None:
    bench.clock(SECOND)
    bench.bus.events.append(Presence(ServiceId("planner", "amr1"), alive=False))
    bench.frame()
    bench.end()
    told = [
        text
        for chunk in reading.chunks(bench.file(1))
        if chunk.entity_path == "/bus/log"
        for [text] in chunk.to_record_batch()["TextLog:text"].to_pylist()
    ]
    assert "amr1/planner is down" in told


def test_frames_keep_their_pace_where_the_machine_does_and_wait_where_it_does_not() -> None:
    period = 0.04
    assert next_frame(due=1.0, begun=1.0, ended=1.003, period=period) == pytest.approx(1.04)
    assert next_frame(due=1.0, begun=1.02, ended=1.024, period=period) == pytest.approx(1.06)
    assert next_frame(due=1.0, begun=1.0, ended=1.1, period=period) == pytest.approx(2.0)
    assert next_frame(due=1.0, begun=1.0, ended=1.5, period=period) == pytest.approx(2.5), "at most a second"


def test_what_came_after_the_last_frame_is_recorded_at_the_end(bench: Bench) -> None:
    bench.clock(SECOND)
    bench.frame()
    crate_pose = ObjectPose(name="crate", position=(1, 2, 3), orientation=UPRIGHT)
    bench.tell(topics.OBJECTS, "world", Objects(stamp=SECOND, objects=(crate_pose,)))
    bench.end()
    assert reading.newest(bench.file(1))["crate"][0] == (1, 2, 3)
