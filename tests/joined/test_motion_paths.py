"""Task paths of both arms where kinematics are hard: singularities, the edge of reach, what is appended on the way."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.schemas.crf import CrfCode
from rackhand.services.controller import ik
from rackhand.services.controller.motion.kinematics import ArmKinematics
from rackhand.services.controller.motion.profile import hardware_limits
from rackhand.services.controller.trajectory.continuation import follow
from rackhand.services.controller.trajectory.geometry import Tolerance, task_path
from rackhand.services.controller.trajectory.model import PathRefused, TcpPose
from tests.joined.arm import JoinedArm
from tests.joined.checks import BAD, PERIOD, Array, check_commands, check_limits, off_line, pose, speeds, tools

Either = tuple[JoinedArm, ik.Arm]

# From one posture to another, a straight line of the tool. On the way the UR's wrist 2 passes 0, where joints 4 and 6
# are parallel; the FR3's wrist passes above its shoulder, where joint 1 cannot move it and joints 3 and 5 are no help.
SINGULAR = {
    "ur5e": ([0.0, -1.5708, 1.5708, -1.5708, -0.3, 0.0], [0.0, -1.5708, 1.5708, -1.5708, 0.3, 0.0]),
    "fr3": (
        [-1.402, 0.043, -1.782, -0.422, 1.632, 1.645, 1.307],
        [-1.094, -0.043, -1.182, -0.522, 1.308, 1.601, 1.613],
    ),
}


def on_line(a: Array, b: Array, points: Array) -> float:
    """The farthest that any of the points (m, 3) is from the segment between two points."""
    line = np.array([a + share * (b - a) for share in np.linspace(0, 1, 400)])
    return max(off_line(line, p) for p in points)


def tool_speeds(points: Array) -> Array:
    return np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=1) / (PERIOD / 2))


def test_a_path_through_a_singularity_slows_down_and_finishes(either: Either) -> None:
    station, arm = either
    begin, through = (np.array(q) for q in SINGULAR[arm.name])
    station.drive_to(begin)
    a, b = ik.forward(arm, begin), ik.forward(arm, through)
    station.ok(command="appendPath", type="task", data=[pose(b)], method=2, reference=1)
    states = station.advance(10.0)
    driven = tools(states, arm)
    kinematics = ArmKinematics(arm)
    least = min(float(np.linalg.svd(kinematics.jacobian(np.array(s.q)))[1][-1]) for s in states)
    off = on_line(a[:, 3], b[:, 3], driven[:, :, 3])
    moving = tool_speeds(driven[:, :, 3])
    fastest = np.abs([s.dq for s in states]).max(axis=0) / arm.limits.velocity
    print(f"{arm.name}: least singular value {least:.1e}, off the line {off * 1e3:.3f} mm,")
    print(f"  tool {moving.max():.3f} m/s, joints up to {fastest.max():.2f} of their speed")
    assert least < 5e-3, "the path does lead through"
    assert np.abs(driven[-1] - b).max() < 1e-4 and speeds(states)[-1] < 1e-3, "it finishes"
    assert off <= 1e-3
    profile = 0.25 * arm.limits.task_velocity[0]
    assert fastest.max() > 0.3 and moving.max() < 0.6 * profile, "the joints set the pace"
    assert CrfCode.LowManipulability in station.status()["controllerStatus"]
    check_limits(states, arm)
    check_commands(station.commands(), arm)


def edge_of_reach(arm: ik.Arm, start: Array, direction: Array) -> float:
    """How far (m, to 10 µm) the tool can go from home in a direction before the path is refused."""
    kinematics, limits = ArmKinematics(arm), hardware_limits(arm)

    def reaches(distance: float) -> bool:
        points = [TcpPose(start[:, 3] + d * direction, start[:, :3]) for d in (0.0, distance)]
        try:
            follow(kinematics, limits, task_path(points, Tolerance()), arm.home)
        except PathRefused:
            return False
        return True

    low, high = 0.05, 1.5
    while high - low > 1e-5:
        low, high = ((low + high) / 2, high) if reaches((low + high) / 2) else (low, (low + high) / 2)
    return low


def outwards(arm: ik.Arm, distance: float) -> Array:
    """TcpPose with the tool so far away from its home, on the line from the base through it."""
    shifted = ik.forward(arm, arm.home)
    shifted[:, 3] *= 1 + distance / np.linalg.norm(shifted[:, 3])
    return shifted


def test_a_path_to_the_edge_of_reach_slows_down_and_finishes(either: Either) -> None:
    station, arm = either
    start = ik.forward(arm, arm.home)
    edge = edge_of_reach(arm, start, start[:, 3] / np.linalg.norm(start[:, 3]))
    end = outwards(arm, edge - 1e-4)
    station.advance(0.1)
    station.commands()
    station.ok(command="setProfileVelocity", type="task", data=[0.25] * 3 + [1.0] * 3)
    station.ok(command="appendPath", type="task", data=[pose(end)], method=2, reference=1)
    states = station.advance(5.0)
    station.ok(command="appendPath", type="task", data=[pose(start)], method=2, reference=1)
    states += station.advance(5.0)
    points = tools(states, arm)[:, :, 3]
    off = on_line(start[:, 3], end[:, 3], points)
    there = int(np.linalg.norm(points - end[:, 3], axis=1).argmin())
    left = np.linalg.norm(points[:there] - end[:, 3], axis=1)
    at = int(np.argmax(left < 0.01))
    speed = tool_speeds(points)[at]
    alone = np.sqrt(2 * 0.01 * 0.25 * arm.limits.task_acceleration[0])  # what the task's own limit would allow there
    print(f"{arm.name}: edge {edge * 1e3:.2f} mm from home, missed by {left.min() * 1e6:.0f} µm, off {off * 1e3:.3f}")
    print(f"  10 mm before it {speed:.3f} m/s of {min(alone, 0.25):.3f}")
    assert left.min() < 1e-4 and off <= 1e-3
    assert speed < 0.75 * min(alone, 0.25), "the joints slow it down"
    assert np.abs(tools(states, arm)[-1] - start).max() < 1e-4 and speeds(states)[-1] < 1e-3
    check_limits(states, arm)
    check_commands(station.commands(), arm)


@pytest.mark.parametrize("method", [1, 2])
def test_a_path_beyond_reach_is_refused_as_a_whole_before_anything_moves(either: Either, method: int) -> None:
    station, arm = either
    start = ik.forward(arm, arm.home)
    edge = edge_of_reach(arm, start, start[:, 3] / np.linalg.norm(start[:, 3]))
    points = [pose(outwards(arm, d)) for d in (0.05, 0.1, edge + 0.02, 0.0)]
    answer = station.ask("a", command="appendPath", priority=10, type="task", data=points, method=method, reference=1)
    print(answer["text"])
    assert answer["message"] == BAD
    assert "waypoint 2" in answer["text"] and "mm" in answer["text"]
    states = station.advance(0.5)
    assert np.ptp([s.q for s in states], axis=0).max() < 1e-6
    status = station.status()
    assert status["isTrajectoryRunning"]["value"] is False
    station.ok(command="appendPath", type="task", data=points[:2], method=method, reference=1)
    assert np.abs(tools(station.advance(3.0), arm)[-1] - outwards(arm, 0.1)).max() < 1e-4, "what is left of it drives"


def test_what_is_appended_on_the_way_goes_on_without_a_stop(either: Either) -> None:
    """0.2 m, then, from its middle on, another 0.2 m around a corner of 45°: blended, at the speed of the profile."""
    station, arm = either
    start = ik.forward(arm, arm.home)
    corner, end = start.copy(), start.copy()
    corner[:, 3] += (0.0, 0.2, 0.0)
    end[:, 3] += (0.0, 0.2 + 0.14142, -0.14142)
    station.advance(0.1)
    station.commands()
    station.ok(command="setProfileVelocity", type="task", data=[0.2] * 3 + [1.0] * 3)
    station.ok(command="appendPath", type="task", data=[pose(corner)], method=2, reference=1)
    states = station.advance(0.6)
    station.ok(command="appendPath", type="task", data=[pose(end)], method=2, reference=1)
    states += station.advance(4.0)
    points = tools(states, arm)[:, :, 3]
    moving = tool_speeds(points)
    near = np.linalg.norm(points[1:] - corner[:, 3], axis=1) < 0.05
    passed = np.linalg.norm(points - corner[:, 3], axis=1).min()
    print(f"{arm.name}: {moving[near].min():.3f} m/s at least about the corner, passed by {passed * 1e3:.2f} mm")
    assert moving[near].min() > 0.19
    assert 0.005 < passed < 0.0101, "blended as documented"
    assert np.abs(tools(states, arm)[-1] - end).max() < 1e-4
    check_limits(states, arm)
    check_commands(station.commands(), arm)


@pytest.mark.parametrize("line", [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], ids=["sideways", "up"])
def test_a_velocity_held_into_the_edge_of_reach_keeps_its_line(either: Either, line: list[float]) -> None:
    station, arm = either
    direction = np.array(line)
    start = ik.forward(arm, np.array(station.advance(0.1)[-1].q))[:, 3]
    station.commands()
    states = []
    for k in range(120):
        speed = 0.25 if k < 100 else -0.25
        twist = [*(speed * direction).tolist(), 0.0, 0.0, 0.0]
        station.ok(command="setVelocity", type="task", data=twist, reference=1)
        states += station.advance(0.04)
    away = tools(states, arm)[:, :, 3] - start
    along = away @ direction
    off = np.linalg.norm(away - along[:, None] * direction, axis=1)
    print(f"{arm.name}: {along.max() * 1e3:.1f} mm far, {off.max() * 1e3:.3f} mm off the line")
    assert along.max() > 0.25
    assert off.max() <= 1e-3
    assert along[-1] < along.max() - 1e-3, "it turns back"
    check_commands(station.commands(), arm, jerk=False)
    # Velocities are not bounded in jerk where the arm leaves a singular posture: from one limit of acceleration to the
    # other in a period, which the joint servo overshoots.
    check_limits(states, arm, overshoot=1.8)
