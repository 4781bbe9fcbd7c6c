"""Paths as clients send: repeated points, recordings with noise, circles of many points, streams of single points."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.schemas.arrays import Array
from rackhand.schemas.orientation import quaternion
from rackhand.services.controller import ik
from tests.controller.cell import FR3, UR5E, PerfectArm, moved, pose

BOTH = pytest.mark.parametrize("arm", [UR5E, FR3], ids=["ur5e", "fr3"])


def seconds(cell: PerfectArm, **path: Any) -> float:
    """How long a path takes."""
    cell.history.clear()
    cell.ok("a", command="appendPath", **path)
    taken = cell.until_rest()
    cell.check_limits()
    return taken


def slowest(cell: PerfectArm) -> float:
    """Joint speed [rad/s] in the middle of the path just driven, at its slowest."""
    speed = np.abs(cell.driven()[1]).max(axis=1)
    moving = np.flatnonzero(speed > 1e-3)
    return float(speed[moving[0] + 60 : moving[-1] - 60].min())


def joint_points(points: Array) -> dict[str, Any]:
    return {"type": "joints", "data": np.atleast_2d(points).tolist()}


def tool_points(*matrices: Array) -> dict[str, Any]:
    return {"type": "task", "method": 2, "reference": 1, "data": [pose(each) for each in matrices]}


@BOTH
@pytest.mark.parametrize("apart", [1e-6, 1e-4])
@pytest.mark.parametrize("kind", ["joints", "task"])
def test_a_corner_that_is_given_twice_costs_nothing(arm: ik.Arm, kind: str, apart: float) -> None:
    def path(*repeated: float) -> dict[str, Any]:
        if kind == "task":
            start = ik.forward(arm, arm.home)
            return tool_points(*(moved(start, 0.0, 0.1, -offset) for offset in (0.0, *repeated, 0.1)))
        there, back = np.zeros(arm.n), np.zeros(arm.n)
        there[0], back[1] = 0.4, 1.0
        return joint_points(np.array([arm.home + there + offset * back for offset in (0.0, *repeated, 0.3)]))

    once, cell = PerfectArm(arm), PerfectArm(arm)
    ideal, taken = seconds(once, **path()), seconds(cell, **path(apart))
    assert taken < 1.03 * ideal, f"{taken:.2f} s, {ideal:.2f} s without the repeated point"
    assert slowest(cell) > 0.8 * slowest(once)


@BOTH
def test_a_circle_takes_its_time_however_many_points_it_has(arm: ik.Arm) -> None:
    start, taken = ik.forward(arm, arm.home), []
    for count in (24, 1500):
        angles = np.linspace(0, 2 * np.pi, count + 1)[1:]
        cell = PerfectArm(arm)
        circle = tool_points(*(moved(start, 0.0, 0.05 * np.sin(a), 0.05 * (np.cos(a) - 1)) for a in angles))
        taken.append(seconds(cell, **circle))
        tools = np.array([cell.tool(q)[:, 3] for q in cell.driven()[0][::5]])
        radius = np.linalg.norm(tools - start[:, 3] + (0.0, 0.0, 0.05), axis=1)
        assert np.abs(radius - 0.05).max() < 2e-3
        assert np.abs(cell.tool()[:, 3] - start[:, 3]).max() < 1e-6, "the last point is reached exactly"
    assert taken[1] < 1.1 * taken[0]


@BOTH
def test_a_recording_with_noise_takes_its_smoothed_time(arm: ik.Arm) -> None:
    """400 points at 100 Hz with 50 µrad of encoder noise."""
    rng, t = np.random.default_rng(3), np.linspace(0, 1, 401)[1:]
    smooth = arm.home + np.outer(np.sin(2 * np.pi * t), np.linspace(0.4, 0.1, arm.n)) + 0.3 * t[:, None]
    ideal = seconds(PerfectArm(arm), **joint_points(smooth))
    taken = seconds(PerfectArm(arm), **joint_points(smooth + rng.normal(scale=5e-5, size=smooth.shape)))
    coarse = seconds(PerfectArm(arm), **joint_points(smooth[19::20]))
    assert taken < 1.1 * ideal and taken < 1.2 * coarse, f"{taken:.2f} s, {ideal:.2f} s exact, {coarse:.2f} s coarse"


def test_a_tool_recording_with_noise_takes_its_smoothed_time() -> None:
    """400 points with 1 µm and 5 µrad of noise."""
    rng, start = np.random.default_rng(4), ik.forward(UR5E, UR5E.home)
    smooth = [moved(start, 0.03 * np.sin(2 * a), 0.15 * np.sin(a), 0.05 * a) for a in np.linspace(0, 3, 401)[1:]]
    noisy = [moved(each, *rng.normal(scale=1e-6, size=3)) for each in smooth]
    ideal = seconds(PerfectArm(), **tool_points(*smooth))
    taken = seconds(PerfectArm(), **tool_points(*noisy))
    coarse = seconds(PerfectArm(), **tool_points(*smooth[19::20]))
    assert taken < 1.1 * ideal and taken < 1.2 * coarse, f"{taken:.2f} s, {ideal:.2f} s exact, {coarse:.2f} s coarse"


def test_points_on_a_line_of_the_tool_are_kept_where_joints_move_straight() -> None:
    """Method 1: the tool passes each point, though they are on one line."""
    cell, start = PerfectArm(), ik.forward(UR5E, UR5E.home)
    line = [moved(start, 0.0, 0.1 * k, 0.0) for k in range(1, 5)]
    cell.ok("a", command="appendPath", **{**tool_points(*line), "method": 1})
    cell.until_rest()
    tools = np.array([cell.tool(q)[:, 3] for q in cell.driven()[0]])
    missed = [np.linalg.norm(tools - point[:, 3], axis=1).min() for point in line]
    assert max(missed) < 5e-3


@pytest.mark.parametrize("size", [5e-8, 3e-7, 4e-6, 2e-5, 1e-4])
@pytest.mark.parametrize("turn", [False, True])
def test_a_tiny_tool_path_is_driven_or_refused(size: float, turn: bool) -> None:
    cell = PerfectArm()
    rotation = {"AngleAxis": {"Angle": size if turn else 0.0, "Axis": [1, 0, 0]}}
    target = {"Position": [0, 0, 0.0 if turn else size], "Orientation": rotation}
    answer = cell.ask("a", command="appendPath", priority=10, type="task", method=2, reference=2, data=[target])
    cell.until_rest()
    assert not cell.errors
    if size < 5e-6:
        assert answer["message"]["code"] == 400 and "no motion" in answer["text"]
    else:
        assert answer["message"]["code"] == 200, answer


@pytest.mark.parametrize("digits", [3, 4, 5])
def test_a_quaternion_of_a_few_digits_is_normalised(digits: int) -> None:
    cell = PerfectArm()
    start = cell.tool()
    rounded = dict(zip("WXYZ", np.round(quaternion(start[:, :3]), digits).tolist(), strict=True))
    target = {"Position": (start[:, 3] + (0, 0.05, 0)).tolist(), "Orientation": {"Quaternion": rounded}}
    cell.ok("a", command="appendPath", type="task", method=2, reference=1, data=[target])
    cell.until_rest()
    assert np.abs(cell.tool()[:, :3] - start[:, :3]).max() < 3 * 10.0**-digits


@pytest.mark.parametrize("kind", ["joints", "task"])
def test_single_points_at_20_hz_are_driven_without_a_stop(kind: str) -> None:
    """Running free, each planned beside the motion: a circle at 0.1 m/s, or a turn at 0.3 rad/s."""
    cell, start = PerfectArm(lockstep=False), ik.forward(UR5E, UR5E.home)
    for k in range(80):
        t = 0.048 * (k + 1)
        goal = UR5E.home + 0.3 * t * (np.arange(6) == 0)
        tool = moved(start, 0.0, 0.1 * np.sin(t), 0.1 * (np.cos(t) - 1))
        cell.ok("a", command="appendPath", **(joint_points(goal) if kind == "joints" else tool_points(tool)))
        cell.advance(0.048)
    cell.until_rest()
    speed = np.abs(cell.driven()[1]).max(axis=1)
    moving = np.flatnonzero(speed > 1e-3)
    assert speed[moving[0] + 50 : moving[-1] - 50].min() > 0.03
    assert not cell.errors
    cell.check_limits()


def test_a_long_path_is_joined_as_soon_as_it_is_planned() -> None:
    """Running free: 200 points behind a path that is driven before their lead is over."""
    cell = PerfectArm(lockstep=False)
    turn = np.arange(6) == 0
    cell.ok("a", command="appendPath", **joint_points(UR5E.home + 0.1 * turn))
    back = np.array([UR5E.home + 0.1 * (1 - k / 200) * turn for k in range(1, 201)])
    cell.ok("a", command="appendPath", **joint_points(back))
    taken = cell.until_rest()
    alone = seconds(PerfectArm(), **joint_points(UR5E.home + 0.1 * turn))
    assert taken < 2 * alone + 0.05, f"{taken:.2f} s, one way takes {alone:.2f} s"
