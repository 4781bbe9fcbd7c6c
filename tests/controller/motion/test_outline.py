"""The way that is shown is the way that is driven."""

from __future__ import annotations

import numpy as np

from rackhand.services.controller import ik
from rackhand.services.controller.motion.kinematics import ArmKinematics
from rackhand.services.controller.motion.outline import MOST, outline
from rackhand.services.controller.motion.profile import MotionProfile, path_arm
from rackhand.services.controller.trajectory.model import TcpPose
from rackhand.services.controller.trajectory.queue import Method, MotionQueue, ReferenceFrame

ARM = ik.load_arm("ur5e")
KINEMATICS = ArmKinematics(ARM)
REST = MotionQueue(path_arm(ARM, MotionProfile.default(ARM)), ARM.home)


def tool(q: np.ndarray) -> np.ndarray:
    return KINEMATICS.forward(q).translation


def test_an_empty_queue_has_no_way() -> None:
    points, ends = outline(REST, 0.0, KINEMATICS)
    assert points.shape == (0, 3) and ends == ()


def test_the_way_leads_from_where_the_tool_is_to_where_the_queue_ends() -> None:
    queue = REST.append_joints(0.0, [ARM.home + 0.2, ARM.home - 0.1])
    for t in (0.0, 0.3):
        points, ends = outline(queue, t, KINEMATICS)
        assert np.allclose(points[0], tool(queue.at(t).q), atol=1e-9)
        assert np.allclose(points[-1], tool(ARM.home - 0.1), atol=1e-6)
        assert ends == (len(points) - 1,)
        assert 10 < len(points) <= MOST + 2


def test_a_line_is_shown_as_one() -> None:
    start = KINEMATICS.forward(ARM.home)
    goal = TcpPose(start.translation + np.array([0.0, 0.2, -0.1]), start.rotation)
    points, _ = outline(REST.append_task(0.0, [goal], Method.TASK_SPACE, ReferenceFrame.BASE), 0.0, KINEMATICS)
    along = (goal.translation - start.translation) / np.linalg.norm(goal.translation - start.translation)
    away = points - start.translation
    assert np.linalg.norm(away - np.outer(away @ along, along), axis=1).max() < 1e-5
    assert np.allclose(points[-1], goal.translation, atol=1e-5)


def test_after_a_stop_the_way_ends_where_the_arm_will_stand() -> None:
    queue = REST.append_joints(0.0, [ARM.home + 0.5]).soft_stop(0.4)
    points, _ = outline(queue, 0.4, KINEMATICS)
    assert np.allclose(points[-1], tool(queue.motions[0].motion.rest), atol=1e-6)


def test_several_motions_end_where_they_say() -> None:
    start = KINEMATICS.forward(ARM.home)
    goal = TcpPose(start.translation + np.array([0.0, 0.1, 0.0]), start.rotation)
    line = REST.append_task(0.0, [goal], Method.TASK_SPACE, ReferenceFrame.BASE)
    both = line.append_task(0.1, [TcpPose(start.translation, start.rotation)], Method.JOINT_SPACE, ReferenceFrame.BASE)
    points, ends = outline(both, 0.1, KINEMATICS)
    assert len(ends) == len(both.motions) and ends[-1] == len(points) - 1
    assert np.allclose(points[ends[0]], tool(both.motions[0].motion.rest), atol=1e-5)
