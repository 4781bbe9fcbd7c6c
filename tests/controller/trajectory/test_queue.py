from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.continuation import pose_error
from rackhand.services.controller.trajectory.geometry import JointPath, TaskPath
from rackhand.services.controller.trajectory.joint_stop import JointStop
from rackhand.services.controller.trajectory.model import PathRefused, TaskLimits, TcpPose
from rackhand.services.controller.trajectory.queue import Method, MotionQueue, PathArm, ReferenceFrame
from rackhand.services.controller.trajectory.stream import Motion, PathLimits
from tests.controller.trajectory.arms import UR5E, UR5E_HOME, UR5E_LIMITS
from tests.controller.trajectory.helpers import record

TASK = PathLimits(UR5E_LIMITS, TaskLimits(np.full(6, 0.5), np.full(6, 2.0)))
ARM = PathArm(UR5E, PathLimits(UR5E_LIMITS), TASK)
IDLE = MotionQueue(ARM, UR5E_HOME)
HERE = UR5E.forward(UR5E_HOME)


def joints(*offsets: float) -> list[Array]:
    return [UR5E_HOME + offset for offset in offsets]


def poses(*offsets: tuple[float, float, float]) -> list[TcpPose]:
    return [TcpPose(HERE.translation + np.array(offset), HERE.rotation) for offset in offsets]


def task(queue: MotionQueue, t: float, *offsets: tuple[float, float, float]) -> MotionQueue:
    return queue.append_task(t, poses(*offsets), Method.TASK_SPACE, ReferenceFrame.BASE)


def smooth(*queues: tuple[float, MotionQueue]) -> None:
    """Driven one after the other, each from its time on: nothing jumps, no limit is broken."""
    last_time, last = queues[-1]

    def at(t: float):  # type: ignore[no-untyped-def]
        return next(queue for since, queue in reversed(queues) if since <= t or queue is queues[0][1]).at(t)

    seen = record(at, queues[0][0], max(last_time, last.motions[-1].motion.end) + 0.02)
    assert seen.jumps()[0] < 1e-6
    assert seen.jumps()[1] < 1e-3 * UR5E_LIMITS.jerk.max() * seen.dt
    assert max(seen.use(UR5E_LIMITS)) <= 1.02


def test_an_idle_queue_stands_still() -> None:
    sample = IDLE.at(5.0)
    assert np.array_equal(sample.q, UR5E_HOME)
    assert not sample.dq.any()
    assert not IDLE.running(5.0)


def test_joint_points_are_driven_in_order_and_points_of_the_same_kind_are_appended() -> None:
    first = IDLE.append_joints(10.0, joints(0.3, 0.1))
    second = first.append_joints(10.2, joints(0.5))
    assert len(second.motions) == 1
    assert first.running(10.2)
    end = second.motions[-1].motion.end
    assert not second.running(end)
    assert np.abs(second.at(end).q - UR5E_HOME - 0.5).max() < 1e-9
    smooth((10.0, first), (10.2, second))


def test_points_appended_after_the_end_begin_then() -> None:
    first = IDLE.append_joints(0.0, joints(0.3))
    later = first.append_joints(20.0, joints(0.0))
    assert len(later.motions) == 1
    assert later.motions[0].begin == 20.0
    assert np.abs(later.at(20.0).q - UR5E_HOME - 0.3).max() < 1e-9
    smooth((0.0, first), (20.0, later))


@pytest.mark.parametrize("first", ["joints", "task"])
def test_another_kind_stops_softly_and_drops_what_was_queued(first: str) -> None:
    if first == "joints":
        before = IDLE.append_joints(0.0, joints(0.6, 0.0))
        after = task(before, 0.3, (0.0, 0.1, 0.0))
    else:
        before = task(IDLE, 0.0, (0.0, 0.2, 0.0), (0.0, 0.2, 0.2))
        after = before.append_joints(0.3, joints(0.2))
    stopping, new = after.motions
    assert stopping.stopped
    assert stopping.motion.end < before.motions[0].motion.end
    assert new.begin == stopping.motion.end
    assert isinstance(new.motion, Motion)
    assert isinstance(new.motion.path, TaskPath if first == "joints" else JointPath)
    smooth((0.0, before), (0.3, after))
    goal = poses((0.0, 0.1, 0.0))[0] if first == "joints" else UR5E.forward(UR5E_HOME + 0.2)
    assert np.abs(pose_error(UR5E.forward(after.at(1e3).q), goal)).max() < 1e-6


def test_a_refused_path_changes_nothing() -> None:
    moving = IDLE.append_joints(0.0, joints(0.6, 0.0))
    for call in (
        lambda: task(moving, 0.3, (0.0, 0.1, 0.0), (0.0, 5.0, 0.0)),
        lambda: moving.append_joints(0.3, [*joints(0.1), UR5E_HOME + 20.0]),
        lambda: moving.append_joints(0.3, [np.zeros(5)]),
        lambda: moving.append_joints(0.3, [UR5E_HOME * np.nan]),
        lambda: moving.append_task(0.3, poses((0, np.nan, 0)), Method.TASK_SPACE, ReferenceFrame.BASE),
        lambda: moving.append_task(0.3, poses((0, 5.0, 0)), Method.JOINT_SPACE, ReferenceFrame.BASE),
    ):
        with pytest.raises(PathRefused):
            call()
    assert len(moving.motions) == 1
    assert not moving.motions[0].stopped


def test_refusals_say_which_waypoint_and_by_how_much() -> None:
    with pytest.raises(PathRefused, match=r"waypoint 1: joint \d at .* rad is .* rad outside"):
        IDLE.append_joints(0.0, [*joints(0.1), UR5E_HOME + 20.0])
    with pytest.raises(PathRefused, match="waypoint 0: 5 numbers for 6 joints"):
        IDLE.append_joints(0.0, [np.zeros(5)])
    # The first of the three is where the arm is: left out, and still counted.
    with pytest.raises(PathRefused, match="waypoint 2: out of reach") as refused:
        task(IDLE, 0.0, (0.0, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 5.0, 0.0))
    assert refused.value.point == 2


def test_duplicates_are_left_out_and_a_task_path_of_nothing_else_is_refused() -> None:
    assert IDLE.append_joints(0.0, joints(0.0, 0.0)).motions == ()
    assert IDLE.append_joints(0.0, [*joints(0.3, 0.3), UR5E_HOME + 0.3 + 1e-9]).motions[0].motion.path.legs.s.size == 2  # type: ignore[union-attr]
    with pytest.raises(PathRefused, match="no motion"):
        task(IDLE, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_points_in_the_tcp_frame_are_composed_with_its_pose_at_the_call_and_not_chained() -> None:
    step = TcpPose(np.array([0.0, 0.0, 0.05]), np.eye(3))
    farther = TcpPose(np.array([0.0, 0.0, 0.08]), np.eye(3))
    queue = IDLE.append_task(0.0, [step, farther], Method.TASK_SPACE, ReferenceFrame.TCP)
    assert np.abs(pose_error(UR5E.forward(queue.at(1e3).q), HERE @ farther)).max() < 1e-6
    moving = IDLE.append_joints(0.0, joints(0.4))
    now = UR5E.forward(moving.at(0.2).q)
    queue = moving.append_task(0.2, [step], Method.TASK_SPACE, ReferenceFrame.TCP)
    assert np.abs(pose_error(UR5E.forward(queue.at(1e3).q), now @ step)).max() < 1e-6


def test_task_points_by_joint_space_motion_are_reached_along_joint_lines() -> None:
    goals = poses((0.0, 0.2, 0.1), (0.1, 0.2, 0.0))
    queue = IDLE.append_task(0.0, goals, Method.JOINT_SPACE, ReferenceFrame.BASE)
    assert queue.motions[0].kind == "task"
    assert isinstance(queue.motions[0].motion, Motion)
    assert isinstance(queue.motions[0].motion.path, JointPath)
    assert np.abs(pose_error(UR5E.forward(queue.at(1e3).q), goals[-1])).max() < 1e-6
    # The other method of the same kind waits for it and drops nothing.
    both = task(queue, 0.1, (0.0, 0.0, 0.0))
    assert [queued.stopped for queued in both.motions] == [False, False]
    assert np.abs(pose_error(UR5E.forward(both.at(1e3).q), HERE)).max() < 1e-6
    smooth((0.0, queue), (0.1, both))


def test_a_soft_stop_drops_the_queue_and_a_new_path_begins_at_rest() -> None:
    moving = task(IDLE, 0.0, (0.0, 0.2, 0.0), (0.0, 0.2, 0.2))
    stopped = moving.soft_stop(0.4)
    end = stopped.motions[0].motion.end
    assert end < 0.8
    assert not stopped.running(end)
    assert np.abs(stopped.soft_stop(0.45).at(end).q - stopped.at(end).q).max() == 0.0
    again = task(stopped, 0.5, (0.0, 0.0, 0.1))
    assert again.motions[1].begin == end
    smooth((0.0, moving), (0.4, stopped), (0.5, again))
    assert stopped.soft_stop(end + 1).motions == ()


def test_a_hard_stop_is_faster_and_nothing_moves_after_it() -> None:
    moving = IDLE.append_joints(0.0, joints(1.5, 0.0))
    soft, hard = moving.soft_stop(0.45), moving.hard_stop(0.45)
    assert isinstance(hard.motions[0].motion, JointStop)
    assert hard.motions[0].motion.end < soft.motions[0].motion.end
    smooth((0.0, moving), (0.45, hard))
    end = hard.motions[0].motion.end
    assert not hard.running(end)
    assert np.array_equal(hard.at(end + 10).q, hard.motions[0].motion.rest)
    assert hard.hard_stop(0.5).motions == hard.motions
    assert hard.soft_stop(0.5).motions[0].motion is hard.motions[0].motion


def test_a_pause_holds_all_that_is_queued_until_it_is_resumed() -> None:
    moving = IDLE.append_task(0.0, poses((0.0, 0.2, 0.1)), Method.JOINT_SPACE, ReferenceFrame.BASE)
    moving = task(moving, 0.05, (0.0, 0.0, 0.0))
    paused = moving.pause(0.3)
    held = paused.at(30.0)
    assert not held.dq.any()
    assert not paused.running(30.0)
    longer = task(paused, 20.0, (0.0, -0.1, 0.0))
    assert np.array_equal(longer.at(30.0).q, held.q)
    resumed = longer.resume(40.0)
    assert resumed.running(40.0)
    assert np.abs(pose_error(UR5E.forward(resumed.at(1e3).q), poses((0.0, -0.1, 0.0))[0])).max() < 1e-6
    smooth((0.0, moving), (0.3, paused), (40.0, resumed))
    assert paused.pause(35.0) is paused
    assert moving.resume(0.3) is moving


def test_new_profile_limits_hold_for_what_is_appended_afterwards() -> None:
    slow = replace(UR5E_LIMITS, velocity=np.full(6, 0.2))
    moving = IDLE.append_joints(0.0, joints(1.0))
    changed = replace(moving, arm=replace(moving.arm, joints=PathLimits(slow))).append_joints(0.1, joints(2.0))
    seen = record(changed.at, 0.1, changed.motions[0].motion.end)
    corner = np.abs(seen.q - UR5E_HOME - 1.0).max(axis=1).argmin()
    assert np.abs(seen.dq[: corner - 100]).max() > 1.0
    assert np.abs(seen.dq[corner + 5 :]).max() <= 0.2 * 1.01
