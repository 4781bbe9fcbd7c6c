from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.continuation import pose_error
from rackhand.services.controller.trajectory.geometry import Tolerance, joint_path, rotation_exp, task_path
from rackhand.services.controller.trajectory.joint_stop import stop_joints
from rackhand.services.controller.trajectory.model import PathRefused, TaskLimits, TcpPose
from rackhand.services.controller.trajectory.splice import extend_joints, extend_task
from rackhand.services.controller.trajectory.stream import Motion, PathLimits, Sample, start_joints, start_task
from rackhand.services.controller.trajectory.timing import Planning
from tests.controller.trajectory.arms import FR3, FR3_LIMITS, UR5E, UR5E_HOME, UR5E_LIMITS
from tests.controller.trajectory.helpers import record

PLANNING = Planning()
TOLERANCE = Tolerance()
KEPT = 1.005
"""What is planned at rest keeps its limits to the planner's own check."""
SPLICED = 1.02
"""What changes under way mixes two plans in the filter."""
SEEDS = st.integers(0, 100_000)
PARTS = st.floats(0.02, 0.98)
FREE = PathLimits(FR3_LIMITS)
SLOW = TaskLimits(np.full(6, 0.25), np.full(6, 1.0))
FAST = TaskLimits(np.full(6, 1.5), np.full(6, 8.0))


def waypoints(seed: int) -> Array:
    rng = np.random.default_rng(seed)
    middle, half = (FR3_LIMITS.upper + FR3_LIMITS.lower) / 2, (FR3_LIMITS.upper - FR3_LIMITS.lower) / 2
    scale = rng.choice([0.05, 0.3, 1.0])
    return np.asarray(middle + half * scale * rng.uniform(-0.8, 0.8, (rng.integers(2, 7), 7)))


def moving(seed: int) -> Motion:
    return start_joints(0.0, joint_path(waypoints(seed), TOLERANCE), FREE, PLANNING)


def square(task: TaskLimits, side: float = 0.3) -> tuple[Motion, list[TcpPose]]:
    start = UR5E.forward(UR5E_HOME)
    corners = [(0.0, 0, 0), (0, side, 0), (0, side, side), (0, 0, side), (0, 0, 0)]
    poses = [TcpPose(start.translation + np.array(corner), start.rotation) for corner in corners]
    path = task_path(poses, TOLERANCE)
    return start_task(0.0, path, UR5E_HOME, PathLimits(UR5E_LIMITS, task), PLANNING, UR5E), poses


def changed(before: Motion, after: Motion, t: float, start: float, limits=FR3_LIMITS) -> None:  # type: ignore[no-untyped-def]
    """Where one takes over from the other nothing jumps, and limits are kept across the change."""
    seen = record(lambda now: (before if now < t else after).at(now), start, after.end + 0.01)
    assert seen.jumps()[0] < 1e-6
    assert seen.jumps()[1] < 1e-3 * limits.jerk.max() * seen.dt
    assert max(seen.use(limits)) <= SPLICED


@settings(max_examples=12, deadline=None)
@given(SEEDS)
def test_velocity_acceleration_and_jerk_stay_within_their_limits(seed: int) -> None:
    motion = moving(seed)
    seen = record(motion.at, 0.0, motion.end)
    assert max(seen.use(FR3_LIMITS)) <= KEPT
    assert seen.jumps()[0] < 1e-6
    points = waypoints(seed)
    assert np.abs(seen.q[0] - points[0]).max() < 1e-12
    assert np.abs(motion.at(motion.end).q - points[-1]).max() < 1e-9
    assert np.abs(motion.at(motion.end).dq).max() < 1e-9
    assert motion.at(motion.end).done
    assert not motion.at(motion.end - 0.001).done


@settings(max_examples=12, deadline=None)
@given(SEEDS)
def test_it_does_not_stop_between_waypoints(seed: int) -> None:
    motion = moving(seed)
    inner = record(motion.at, 0.1 * motion.end, 0.9 * motion.end)
    assert np.linalg.norm(inner.dq, axis=1).min() > 0 or len(waypoints(seed)) > 2
    assert (np.diff([motion.at(t).s for t in np.linspace(0, motion.end, 50)]) >= -1e-12).all()


@settings(max_examples=12, deadline=None)
@given(SEEDS, PARTS)
def test_a_soft_stop_stays_on_the_path_within_the_limits(seed: int, part: float) -> None:
    motion = moving(seed)
    t = part * motion.end
    stopped = motion.braked(t)
    changed(motion, stopped, t, max(0.0, t - 0.05))
    for when in np.linspace(t, stopped.end, 25):
        sample = stopped.at(when)
        on_path = motion.curve.derivatives(np.array([sample.s]))[0, 0]
        assert np.abs(sample.q - on_path).max() < 1e-12
    assert np.abs(stopped.at(stopped.end).dq).max() < 1e-9
    assert np.abs(stopped.rest - stopped.at(stopped.end).q).max() < 1e-9
    assert stopped.end <= motion.end
    assert stopped.end - t <= 1.2 * (FR3_LIMITS.velocity / FR3_LIMITS.acceleration).max() + PLANNING.smoothing.total


@settings(max_examples=12, deadline=None)
@given(SEEDS, PARTS, PARTS)
def test_pause_and_resume_reach_the_end_of_the_path(seed: int, part: float, of_stop: float) -> None:
    motion = moving(seed)
    t = part * motion.end
    stopped = motion.braked(t)
    again = t + of_stop * (stopped.end - t)
    resumed = stopped.resumed(again)
    changed(stopped, resumed, again, t)
    assert np.abs(resumed.at(resumed.end).q - waypoints(seed)[-1]).max() < 1e-9


@settings(max_examples=12, deadline=None)
@given(SEEDS, PARTS, st.floats(0.1, 1.0))
def test_an_override_scales_velocities_and_keeps_the_path(seed: int, part: float, rate: float) -> None:
    motion = moving(seed)
    t = part * motion.end
    slower = motion.scaled(t, rate)
    changed(motion, slower, t, max(0.0, t - 0.05))
    # Braking to the new rate takes the time of a stop at most. At low rates the path's grid costs some per cent, and
    # the slack of the plan's check, which is a share of the whole limit, some more.
    settled = min(slower.end - 0.01, t + 1.0)
    assert record(slower.at, settled, slower.end).use(FR3_LIMITS)[0] <= rate * 1.05 + motion.planning.slack
    assert np.abs(slower.at(slower.end).q - waypoints(seed)[-1]).max() < 1e-9


@settings(max_examples=12, deadline=None)
@given(SEEDS, st.integers(0, 100_000), PARTS)
def test_appended_points_splice_in_smoothly(seed: int, more_seed: int, part: float) -> None:
    motion = moving(seed)
    t = part * motion.end
    more = np.vstack([motion.curve.q[-1], waypoints(more_seed)])
    spliced = extend_joints(motion, t, joint_path(more, TOLERANCE, motion.curve.end), TOLERANCE, FREE)
    changed(motion, spliced, t, max(0.0, t - 0.05))
    assert np.abs(spliced.at(spliced.end).q - more[-1]).max() < 1e-9


def test_appending_in_time_does_not_stop_and_costs_what_one_path_costs() -> None:
    points = waypoints(12)
    together = start_joints(0.0, joint_path(points, TOLERANCE), FREE, PLANNING)
    first = start_joints(0.0, joint_path(points[:-1], TOLERANCE), FREE, PLANNING)
    tail = joint_path(points[-2:], TOLERANCE, first.curve.end)
    spliced = extend_joints(first, 0.3 * first.end, tail, TOLERANCE, FREE)
    assert not spliced.path.legs.stop.any()
    assert spliced.end == pytest.approx(together.end, rel=1e-3)


def test_appending_too_late_finishes_the_old_path_first() -> None:
    motion = moving(12)
    more = joint_path(np.vstack([motion.curve.q[-1], waypoints(13)]), TOLERANCE, motion.curve.end)
    t = motion.end - 0.06
    spliced = extend_joints(motion, t, more, TOLERANCE, FREE)
    assert spliced.path.legs.stop.any()
    seen = record(spliced.at, t, spliced.end)
    corner = np.abs(seen.q - motion.curve.q[-1]).max(axis=1).argmin()
    assert np.abs(seen.dq[corner]).max() < 0.02
    changed(motion, spliced, t, t - 0.1)


def test_a_queue_that_is_appended_to_for_long_stays_small() -> None:
    motion = moving(12)
    rng = np.random.default_rng(0)
    sizes, t = [], 0.0
    for _ in range(30):
        t = max(t, motion.end - 0.6)
        end = motion.curve.q[-1]
        more = np.vstack([end, np.clip(end + rng.normal(size=(2, 7)) * 0.3, FR3_LIMITS.lower, FR3_LIMITS.upper)])
        motion = extend_joints(motion, t, joint_path(more, TOLERANCE, motion.curve.end), TOLERANCE, FREE)
        sizes.append((motion.rows.s.size, motion.law.t.size, motion.curve.s.size))
    assert np.max(sizes[5:], axis=0).tolist() < [1500, 1500, 40]
    assert motion.curve.end > 15


@pytest.mark.parametrize("task", [SLOW, FAST], ids=["slow", "fast"])
def test_a_task_path_keeps_joint_and_task_limits(task: TaskLimits) -> None:
    motion, _ = square(task)
    times = np.arange(0.0, motion.end, 0.01)
    samples = [motion.at(t) for t in times]
    assert max(record(motion.at, 0.0, motion.end).use(UR5E_LIMITS)) <= KEPT
    twists = np.array([sample.task.twist for sample in samples if sample.task])
    accels = np.array([sample.task.accel for sample in samples if sample.task])
    assert np.linalg.norm(twists[:, :3], axis=1).max() <= KEPT * task.velocity[0]
    assert (np.abs(accels) <= KEPT * task.acceleration).all()
    if task is SLOW:
        assert np.linalg.norm(twists[:, :3], axis=1).max() > 0.99 * task.velocity[0]
    for sample in samples[::10]:
        assert sample.task is not None
        assert np.abs(pose_error(UR5E.forward(sample.q), sample.task.pose)).max() < 1e-4


def test_corners_of_a_task_path_are_passed_within_the_tolerance_without_a_stop() -> None:
    motion, poses = square(SLOW)
    at = [motion.at(t) for t in np.arange(0.0, motion.end, 0.004)]
    where = np.array([sample.task.pose.translation for sample in at if sample.task])
    for pose in poses[1:-1]:
        assert np.linalg.norm(where - pose.translation, axis=1).min() < TOLERANCE.position + 1e-4
    speed = np.array([np.linalg.norm(sample.task.twist[:3]) for sample in at if sample.task])
    assert speed[100:-100].min() > 0.08


@pytest.mark.parametrize("part", [0.2, 0.5, 0.8])
def test_a_soft_stop_on_a_task_path_leaves_it_by_nothing(part: float) -> None:
    motion, _ = square(FAST)
    t = part * motion.end
    stopped = motion.braked(t)
    changed(motion, stopped, t, t - 0.05, UR5E_LIMITS)
    for when in np.linspace(t, stopped.end, 20):
        sample = stopped.at(when)
        assert sample.task is not None
        assert np.abs(pose_error(UR5E.forward(sample.q), motion.path.at(sample.s).pose)).max() < 1e-4  # type: ignore[union-attr]


@pytest.mark.parametrize("part", [0.3, 0.8, 0.97, 1.0])
def test_task_points_splice_in_smoothly(part: float) -> None:
    motion, poses = square(FAST)
    t = part * motion.end
    turned = TcpPose(
        poses[-1].translation + np.array([0.0, 0.15, 0.05]),
        poses[-1].rotation @ rotation_exp(np.array([0.3, 0.1, 0.2])),
    )
    more = task_path([poses[-1], turned], TOLERANCE, motion.curve.end)
    spliced = extend_task(motion, t, more, TOLERANCE, PathLimits(UR5E_LIMITS, FAST), UR5E)
    changed(motion, spliced, t, t - 0.1, UR5E_LIMITS)
    assert np.abs(pose_error(UR5E.forward(spliced.rest), turned)).max() < 1e-6
    assert bool(spliced.path.legs.stop.any()) == (part > 0.9)


def test_an_appended_point_out_of_reach_is_refused_with_its_own_number() -> None:
    motion, poses = square(SLOW)
    far = TcpPose(poses[-1].translation + np.array([0.0, 3.0, 0.0]), poses[-1].rotation)
    near = TcpPose(poses[-1].translation + np.array([0.0, 0.1, 0.0]), poses[-1].rotation)
    with pytest.raises(PathRefused) as refused:
        more = task_path([poses[-1], near, far], TOLERANCE, motion.curve.end)
        extend_task(motion, 1.0, more, TOLERANCE, PathLimits(UR5E_LIMITS, SLOW), UR5E)
    assert refused.value.point == 1


def test_a_wrist_singularity_slows_the_motion_and_is_passed_within_the_limits() -> None:
    q = UR5E_HOME.copy()
    q[4] = -0.5
    beyond = q.copy()
    beyond[4], beyond[0] = 0.4, q[0] + 0.3
    path = task_path([UR5E.forward(q), UR5E.forward(beyond)], TOLERANCE)
    motion = start_task(0.0, path, q, PathLimits(UR5E_LIMITS, FAST), PLANNING, UR5E)
    assert max(record(motion.at, 0.0, motion.end).use(UR5E_LIMITS)) <= KEPT
    speeds = [
        np.linalg.norm(s.task.twist[:3]) for t in np.linspace(0.2, motion.end - 0.2, 400) if (s := motion.at(t)).task
    ]
    assert min(speeds) < 0.05 < 0.3 < max(speeds)


def test_task_limits_hold_on_joint_paths_too_where_they_are_given() -> None:
    limits = PathLimits(FR3_LIMITS, SLOW)
    motion = start_joints(0.0, joint_path(waypoints(12), TOLERANCE), limits, PLANNING, FR3)
    for t in np.arange(0.0, motion.end, 0.05):
        sample = motion.at(t)
        assert np.linalg.norm((FR3.jacobian(sample.q) @ sample.dq)[:3]) <= 1.01 * SLOW.velocity[0]


@settings(max_examples=12, deadline=None)
@given(SEEDS)
def test_the_joint_stop_comes_to_rest_smoothly_within_the_limits(seed: int) -> None:
    rng = np.random.default_rng(seed)
    dq = rng.uniform(-1, 1, 7) * FR3_LIMITS.velocity
    ddq = rng.uniform(-1, 1, 7) * FR3_LIMITS.acceleration
    stop = stop_joints(3.0, Sample(rng.normal(size=7), dq, ddq, None, 0.0, False), FR3_LIMITS)
    seen = record(stop.at, 3.0, stop.end + 0.02, 0.0005)
    assert np.abs(seen.dq[0] - dq).max() < 1e-12
    assert np.abs(seen.ddq[0] - ddq).max() < 1e-12
    assert seen.jumps()[0] < 1e-7
    assert seen.jumps()[1] < FR3_LIMITS.jerk.max() * seen.dt**2
    assert max(seen.use(FR3_LIMITS)[1:]) <= 1 + 1e-9
    assert np.abs(stop.at(stop.end).dq).max() < 1e-12
    assert np.abs(stop.at(stop.end).q - stop.rest).max() < 1e-12
    # The bound with the acceleration ramping from the wrong end to the limit and down again.
    longest = FR3_LIMITS.velocity / FR3_LIMITS.acceleration + 3.5 * FR3_LIMITS.acceleration / FR3_LIMITS.jerk
    assert stop.end - 3.0 <= longest.max()


def test_motions_are_the_same_every_time() -> None:
    first, second = moving(4), moving(4)
    for t in np.linspace(0, first.end, 30):
        assert np.array_equal(first.at(t).q, second.at(t).q)
        assert np.array_equal(first.at(t).ddq, second.at(t).ddq)
