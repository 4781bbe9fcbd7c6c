from __future__ import annotations

import numpy as np
import pytest

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.continuation import follow, pose_error
from rackhand.services.controller.trajectory.geometry import TaskPath, Tolerance, rotation_exp, task_path
from rackhand.services.controller.trajectory.model import JointLimits, PathRefused, TcpPose
from tests.controller.trajectory.arms import FR3, FR3_HOME, FR3_LIMITS, UR5E, UR5E_HOME, UR5E_LIMITS, Chain

ARMS = pytest.mark.parametrize(
    ("arm", "limits", "home"), [(UR5E, UR5E_LIMITS, UR5E_HOME), (FR3, FR3_LIMITS, FR3_HOME)], ids=["ur5e", "fr3"]
)


def moved(pose: TcpPose, by: tuple[float, float, float], turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> TcpPose:
    return TcpPose(pose.translation + np.array(by), pose.rotation @ rotation_exp(np.array(turn)))


def square(start: TcpPose, side: float) -> TaskPath:
    corners = [(0.0, 0, 0), (0, side, 0), (0, side, -side), (0, 0, -side), (0, 0, 0)]
    return task_path([moved(start, corner) for corner in corners], Tolerance())


@ARMS
def test_the_test_arms_have_the_jacobian_of_their_kinematics(arm: Chain, limits: JointLimits, home: Array) -> None:
    h = 1e-6
    columns = [pose_error(arm.forward(home - h * e), arm.forward(home + h * e)) / (2 * h) for e in np.eye(home.size)]
    assert np.abs(np.array(columns).T - arm.jacobian(home)).max() < 1e-8


@ARMS
def test_the_curve_stays_on_the_path_between_its_knots(arm: Chain, limits: JointLimits, home: Array) -> None:
    path = square(arm.forward(home), 0.3)
    curve = follow(arm, limits, path, home)
    s = np.linspace(0, curve.end, 300)
    for at, q in zip(s, curve.derivatives(s)[0], strict=True):
        error = np.abs(pose_error(arm.forward(q), path.at(at).pose))
        assert error[:3].max() < 2e-5
        assert error[3:].max() < 1e-4
    left, right = curve.derivatives(curve.s, left=True), curve.derivatives(curve.s)
    assert np.abs(left[:3] - right[:3]).max() < 1e-6 * np.abs(right[2]).max()


@ARMS
def test_a_point_out_of_reach_is_refused_with_its_number_and_the_distance(
    arm: Chain, limits: JointLimits, home: Array
) -> None:
    start = arm.forward(home)
    path = task_path([start, moved(start, (0, 0.1, 0)), moved(start, (0, 2.0, 0))], Tolerance())
    with pytest.raises(PathRefused, match=r"waypoint 1: out of reach: .* m before this point .* mm and .*°") as refused:
        follow(arm, limits, path, home)
    assert refused.value.point == 1


def test_a_joint_that_would_leave_its_limits_refuses_the_path() -> None:
    limits = JointLimits(UR5E_HOME - 0.2, UR5E_HOME + 0.2, *(np.ones(6),) * 3)
    start = UR5E.forward(UR5E_HOME)
    path = task_path([start, moved(start, (0, 0.3, 0))], Tolerance())
    with pytest.raises(PathRefused, match=r"waypoint 0: on the path before this point, joint \d at .* rad outside"):
        follow(UR5E, limits, path, UR5E_HOME)


def test_an_arm_that_is_not_where_the_path_begins_is_refused_rather_than_moved_there() -> None:
    class Stuck(Chain):
        def jacobian(self, q: Array) -> Array:  # noqa: ARG002
            return np.zeros((6, 6))

    start = UR5E.forward(UR5E_HOME)
    path = task_path([moved(start, (0.1, 0, 0)), start], Tolerance())
    with pytest.raises(PathRefused, match="not at the start of the path"):
        follow(Stuck(UR5E.table), UR5E_LIMITS, path, UR5E_HOME)


def test_past_a_wrist_singularity_the_wrist_turns_continuously() -> None:
    q = UR5E_HOME.copy()
    q[4] = -0.5
    beyond = q.copy()
    beyond[4], beyond[0] = 0.4, q[0] + 0.3
    path = task_path([UR5E.forward(q), UR5E.forward(beyond)], Tolerance())
    curve = follow(UR5E, UR5E_LIMITS, path, q)
    s = np.linspace(0, curve.end, 4000)
    steps = np.abs(np.diff(curve.derivatives(s)[0], axis=0))
    assert np.abs(curve.q[-1] - curve.q[0])[5] > 2.0, "this path turns the wrist"
    assert steps.max() < 0.05, "continuously"
    assert np.abs(pose_error(UR5E.forward(curve.q[-1]), UR5E.forward(beyond))).max() < 1e-8


def test_the_edge_of_reach_is_reached_and_beyond_it_refused() -> None:
    start = UR5E.forward(UR5E_HOME)
    follow(UR5E, UR5E_LIMITS, task_path([start, moved(start, (-0.357, 0, 0))], Tolerance()), UR5E_HOME)
    with pytest.raises(PathRefused, match="out of reach"):
        follow(UR5E, UR5E_LIMITS, task_path([start, moved(start, (-0.36, 0, 0))], Tolerance()), UR5E_HOME)


def test_a_redundant_arm_turns_away_from_its_limits() -> None:
    """Down past where the minimum-norm motion would take joint 5 or 3 out: the null space keeps them in."""
    start = FR3.forward(FR3_HOME)
    path = task_path([start, moved(start, (0.1, 0.35, -0.3)), moved(start, (-0.1, -0.35, -0.3))], Tolerance())
    curve = follow(FR3, FR3_LIMITS, path, FR3_HOME)
    assert (curve.q > FR3_LIMITS.lower).all()
    assert (curve.q < FR3_LIMITS.upper).all()
