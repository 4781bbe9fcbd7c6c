"""One arm's controller without a bus, on a perfect arm."""

from __future__ import annotations

import json
from importlib.resources import files
from typing import Any

import mujoco
import numpy as np
import pytest

from rackhand.schemas.arrays import Array
from rackhand.schemas.crf import CrfCode
from rackhand.services.controller import ik
from tests.controller.cell import FR3, PERIOD_NS, UR5E, PerfectArm, moved, pose

BAD = {"code": 400, "detail": 0}


def joints(arm: ik.Arm, *offsets: float) -> list[list[float]]:
    return [(arm.home + offset).tolist() for offset in offsets]


def square(start: Array, side: float = 0.4) -> list[Array]:
    """Corners of a square in the plane x = const, ending where it begins; the start is the middle of its lower side."""
    half = side / 2
    return [moved(start, *d) for d in ((0, half, 0), (0, half, -side), (0, -half, -side), (0, -half, 0), (0, 0, 0))]


def off_square(start: Array, points: Array, side: float = 0.4) -> Array:
    """Distance (m,) of points (m, 3) to the square's outline."""
    corners = np.array([c[:, 3] for c in square(start, side)])
    best = np.full(len(points), np.inf)
    for a, b in zip(np.roll(corners, 1, axis=0), corners, strict=True):
        along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        best = np.minimum(best, np.linalg.norm(points - a - along[:, None] * (b - a), axis=1))
    return best


@pytest.mark.parametrize("arm", [UR5E, FR3], ids=["ur5e", "fr3"])
def test_a_joint_path_arrives(arm: ik.Arm) -> None:
    cell = PerfectArm(arm)
    cell.ok("a", command="appendPath", type="joints", data=joints(arm, 0.1, 0.2))
    assert cell.get_status()["isTrajectoryRunning"]["value"] is True
    cell.until_rest()
    assert np.abs(cell.q - arm.home - 0.2).max() < 1e-9
    assert cell.get_status()["isTrajectoryRunning"]["value"] is False
    cell.check_limits()


@pytest.mark.parametrize("method", [1, 2])
@pytest.mark.parametrize("reference", [1, 2])
@pytest.mark.parametrize("arm", [UR5E, FR3], ids=["ur5e", "fr3"])
def test_a_task_path_arrives(arm: ik.Arm, method: int, reference: int) -> None:
    cell = PerfectArm(arm)
    start = cell.tool()
    target = moved(start, 0.03, 0.05, -0.04)
    relative = np.column_stack([start[:, :3].T @ target[:, :3], start[:, :3].T @ (target[:, 3] - start[:, 3])])
    data = [pose(target if reference == 1 else relative)]
    cell.ok("a", command="appendPath", type="task", data=data, method=method, reference=reference)
    cell.until_rest()
    assert np.abs(cell.tool() - target).max() < 1e-5
    cell.check_limits()


@pytest.mark.parametrize("arm", [UR5E, FR3], ids=["ur5e", "fr3"])
def test_a_square_is_followed_at_its_speed(arm: ik.Arm) -> None:
    cell = PerfectArm(arm)
    start = cell.tool()
    cell.ok("a", command="setProfileVelocity", type="task", data=[0.25] * 3 + [1.0] * 3)
    corners = [pose(corner) for corner in square(start, 0.3)]
    cell.ok("a", command="appendPath", type="task", data=corners, method=2, reference=1)
    cell.until_rest()
    q, _ = cell.driven()
    tools = np.array([cell.tool(each) for each in q])
    off = off_square(start, tools[:, :, 3], 0.3)
    assert off.max() < 0.0101, "corners are blended within 10 mm"
    assert np.median(off) < 5e-5
    speed = np.linalg.norm(np.diff(tools[:, :, 3], axis=0), axis=1) / (PERIOD_NS * 1e-9)
    assert 0.245 < speed.max() <= 0.2501
    assert np.abs(tools[:, :, :3] - start[:, :3]).max() < 1e-4
    cell.check_limits()


def test_appended_points_are_driven_without_a_stop() -> None:
    cell = PerfectArm()
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 0.5))
    cell.advance(0.3)
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 1.0))
    cell.until_rest()
    _, dq = cell.driven()
    moving = np.abs(dq[:, 0]) > 0.1
    assert np.abs(cell.q - UR5E.home - 1.0).max() < 1e-9
    assert np.diff(moving.astype(int)).tolist().count(1) == 1, "it began to move once only"
    cell.check_limits()


def test_another_type_stops_softly_and_then_begins() -> None:
    cell = PerfectArm()
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 1.0))
    cell.advance(0.4)
    target = moved(cell.tool(), 0.0, 0.0, 0.1)
    cell.ok("a", command="appendPath", type="task", data=[pose(target)], method=1, reference=1)
    cell.until_rest()
    assert np.abs(cell.tool() - target).max() < 1e-4
    cell.check_limits()


def test_an_unreachable_path_is_refused_as_a_whole() -> None:
    cell = PerfectArm()
    start = cell.tool()
    path = [pose(moved(start, 0, 0.05, 0)), pose(moved(start, 0, 5.0, 0))]
    for method in (1, 2):
        answer = cell.ask("a", command="appendPath", priority=10, type="task", data=path, method=method, reference=1)
        assert answer["message"] == BAD
        assert "waypoint 1" in answer["text"]
    cell.advance(0.5)
    assert np.array_equal(cell.q, UR5E.home), "nothing has moved"


@pytest.mark.parametrize("kind", ["softStop", "hardStop"])
@pytest.mark.parametrize("what", ["path", "velocity", "task velocity", "torque"])
def test_a_stop_ends_whatever_moves_and_nothing_moves_after_it(kind: str, what: str) -> None:
    cell = PerfectArm()
    begin(cell, what)
    cell.advance(0.08)
    assert np.abs(cell.dq).max() > 0.02
    assert cell.ask("b", command=kind)["message"]["value"] is True
    taken = cell.until_rest()
    assert taken < 0.6
    where = cell.q.copy()
    cell.advance(0.5)
    assert np.array_equal(cell.q, where)
    cell.check_limits()
    assert [event.name for event in cell.events][-1] == "stopped"
    refused = cell.ask("a", command="appendPath", priority=10, type="joints", data=joints(UR5E, 0.1))
    assert refused["message"]["code"] == CrfCode.Forbidden, "another client's stop is latched"
    cell.ok("a", command="resumeControl")
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 0.1))
    cell.until_rest()
    assert np.abs(cell.q - UR5E.home - 0.1).max() < 1e-9


def begin(cell: PerfectArm, what: str) -> None:
    match what:
        case "path":
            cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 1.0))
        case "velocity":
            cell.ok("a", command="setVelocity", type="joints", data=[0.3] * 6)
        case "task velocity":
            cell.ok("a", command="setVelocity", type="task", data=[0, 0.1, 0, 0, 0, 0.1], reference=1)
        case "torque":
            cell.ok("a", command="setTorque", type="joints", data=[1.0] * 6)


def test_a_soft_stop_stays_on_the_path() -> None:
    """Also around a corner: what is driven after the stop lies on what is driven without it."""

    def run(stop: bool) -> tuple[PerfectArm, Array]:
        cell = PerfectArm()
        cell.ok("a", command="setProfileVelocity", type="task", data=[0.25] * 3 + [1.0] * 3)
        corners = [pose(corner) for corner in square(cell.tool())]
        cell.ok("a", command="appendPath", type="task", data=corners, method=2, reference=1)
        cell.advance(0.8)
        if stop:
            assert cell.ask("a", command="softStop")["message"]["value"] is True
        cell.until_rest()
        return cell, np.array([cell.tool(q)[:, 3] for q in cell.driven()[0]])

    stopped, points = run(stop=True)
    _, whole = run(stop=False)
    braking = points[200:]
    assert 0.005 < np.linalg.norm(braking[-1] - braking[0]) < 0.1, "it was fast, and braked"
    ahead, behind = whole[1:], whole[:-1]
    off = []
    for point in braking:
        step = ahead - behind
        along = np.clip(((point - behind) * step).sum(1) / np.maximum((step * step).sum(1), 1e-18), 0, 1)
        off.append(np.linalg.norm(point - behind - along[:, None] * step, axis=1).min())
    assert max(off) < 2e-5
    stopped.check_limits()


@pytest.mark.parametrize("what", ["velocity", "task velocity"])
def test_a_velocity_is_reached_and_dies_after_100_ms_of_silence(what: str) -> None:
    cell = PerfectArm()
    for _ in range(6):
        begin(cell, what)
        cell.advance(0.048)
    speed = np.abs(cell.dq).max()
    assert speed > 0.09
    cut = cell.stamp - 48_000_000
    while cell.stamp < cut + 100_000_000:
        assert np.abs(cell.dq).max() >= 0.98 * speed
        cell.advance(0.004)
    cell.until_rest()
    after = [np.abs(dq).max() for stamp, _, dq in cell.history if stamp > cut + 108_000_000]
    # To rounding: a velocity is the difference of two positions, of radians, over 4 ms.
    assert (np.diff(after) <= 1e-12).all(), "decays monotonically"
    assert len(after) * PERIOD_NS < 150_000_000
    assert cell.get_status()["controllerStatus"] == sorted(cell.get_status()["controllerStatus"])
    cell.check_limits()


def test_a_joint_velocity_stops_at_the_end_of_the_range() -> None:
    cell = PerfectArm()
    for _ in range(90):
        cell.ok("a", command="setVelocity", type="joints", data=[3.0, 0, 0, 0, 0, -3.0])
        cell.advance(0.04)
    cell.check_limits()
    assert cell.q[0] > UR5E.limits.upper[0] - 0.01
    assert np.abs(cell.dq).max() < 1e-2


def test_a_torque_ends_in_a_stop_after_100_ms() -> None:
    cell = PerfectArm()
    cell.ok("a", command="setTorque", type="joints", data=[2.0] * 6)
    cell.advance(0.096)
    assert cell.tick().mode == "torque"
    cell.advance(0.008)
    assert cell.tick().mode == "position"
    cell.until_rest(0.5)


def mujoco_jacobian(name: str, q: Array) -> Array:
    """(6, n) of the flange in base axes, computed by MuJoCo from the arm's MJCF: independent of the controller."""
    xml = (files("rackhand.worlds.arms") / f"{name}.xml").read_text(encoding="utf-8")
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    linear, angular = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, linear, angular, model.site("flange").id)
    return np.vstack([linear, angular])


@pytest.mark.parametrize("arm", [UR5E, FR3], ids=["ur5e", "fr3"])
@pytest.mark.parametrize("wrench", [[0, 0, 5, 0, 0, 0], [1, -2, 0.5, 0, 0, 0], [0, 0, 0, 0.3, -0.2, 0.4]])
def test_a_wrench_at_the_tool_becomes_joint_torques(arm: ik.Arm, wrench: list[float]) -> None:
    cell = PerfectArm(arm)
    cell.ok("a", command="setTorque", type="task", data=wrench, reference=1)
    cell.advance(0.004)
    assert cell.command is not None and cell.command.mode == "torque"
    expected = mujoco_jacobian(arm.name, cell.q).T @ np.array(wrench)
    assert np.abs(np.array(cell.command.values) - expected).max() < 1e-6
    assert np.abs(expected).max() > 0.1


def test_a_wrench_in_tool_axes_is_turned_into_the_base() -> None:
    cell = PerfectArm()
    cell.ok("a", command="setTorque", type="task", data=[0, 0, 5, 0, 0, 0], reference=2)
    cell.advance(0.004)
    assert cell.command is not None
    force = 5.0 * cell.tool()[:, 2]
    expected = mujoco_jacobian("ur5e", cell.q)[:3].T @ force
    assert np.abs(np.array(cell.command.values) - expected).max() < 1e-6


def test_a_runaway_torque_is_braked_before_a_limit() -> None:
    cell = PerfectArm()
    for _ in range(30):
        cell.ok("a", command="setTorque", type="joints", data=[25.0] * 6)
        cell.advance(0.02)
    _, dq = cell.driven()
    assert (np.abs(dq) <= UR5E.limits.velocity + 0.2).all()
    assert CrfCode.HardwareLimit in cell.get_status()["controllerStatus"]


def test_velocity_takes_over_from_a_path_and_the_other_way_round() -> None:
    cell = PerfectArm()
    begin(cell, "path")
    cell.advance(0.4)
    for _ in range(12):
        cell.ok("a", command="setVelocity", type="joints", data=[0, 0, 0, 0, 0, 0.2])
        cell.advance(0.04)
    assert np.abs(cell.dq - [0, 0, 0, 0, 0, 0.2]).max() < 1e-6
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 0.0))
    cell.until_rest()
    assert np.abs(cell.q - UR5E.home).max() < 1e-9
    cell.check_limits()


def test_expiry_stops_the_arm() -> None:
    cell = PerfectArm(keep_alive_ns=200_000_000)
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 1.5))
    cell.advance(0.2)
    assert cell.get_status()["priorityUnderControl"] == 10
    cell.advance(0.012)
    assert cell.get_status()["priorityUnderControl"] == 0
    assert cell.until_rest(1.0) < 0.5
    assert np.abs(cell.q - UR5E.home).max() < 1.0
    assert [event.name for event in cell.events] == ["controlGranted", "controlLost"]


def test_preemption_stops_before_the_newcomer_moves() -> None:
    cell = PerfectArm()
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 1.5))
    cell.advance(0.4)
    here = cell.q.copy()
    cell.ok("b", priority=5, command="appendPath", type="joints", data=joints(UR5E, 0.0))
    cell.until_rest()
    assert np.abs(cell.q - UR5E.home).max() < 1e-9
    q, _ = cell.driven()
    assert (q.max(axis=0) < here + 0.6).all(), "what the former holder queued was dropped"
    assert cell.ask("a", command="appendPath", priority=10, type="joints", data=joints(UR5E, 0.1))["message"] == {
        "code": 403,
        "detail": 0,
    }
    cell.check_limits()


def test_a_lost_hold_goes_on_when_its_client_resumes() -> None:
    cell = PerfectArm()
    lock = {"command": "lockControl", "priority": 10, "keepAlive": 0.2, "onLoss": "hold"}
    assert cell.ask("a", **lock)["message"] is True
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 1.0))
    cell.advance(0.8)
    assert np.abs(cell.dq).max() < 1e-9
    assert cell.q[0] < UR5E.home[0] + 0.9
    cell.ok("a", command="resumeControl")
    for _ in range(20):
        cell.ask("a", **lock)
        cell.advance(0.1)
    assert np.abs(cell.q - UR5E.home - 1.0).max() < 1e-9
    cell.check_limits()


def test_a_driver_that_is_reset_leaves_no_holder_and_no_motion() -> None:
    cell = PerfectArm()
    begin(cell, "path")
    cell.advance(0.2)
    cell.controller.reset("reset")
    cell.stamp = 0
    cell.halt()
    where = cell.q.copy()
    cell.tick()
    cell.advance(0.5)
    assert np.array_equal(cell.q, where)
    status = cell.get_status()
    assert status["priorityUnderControl"] == 0
    assert status["epoch"] == "e2"
    assert cell.events[-1].info.reason == "restart"


def test_an_unplugged_arm_refuses_motion_and_says_so() -> None:
    cell = PerfectArm()
    cell.controller.reset("the arm's driver has gone")
    answer = cell.ask("a", command="appendPath", priority=10, type="joints", data=joints(UR5E, 0.1))
    assert answer["message"]["code"] == CrfCode.Forbidden
    status = cell.get_status()
    assert status["status"] == "deinitialize"
    assert status["jointPositions"] == {"code": CrfCode.NotInitialized, "detail": 0}


def test_status_streams_of_their_own_sessions() -> None:
    cell = PerfectArm()
    assert cell.ask("a", command="startStreamStatus", frequency=50.0)["message"] is True
    assert cell.ask("b", command="startStreamStatus", frequency=100.0, mode=2)["message"] is True
    cell.advance(1.0)
    counts = {session: sum(1 for to, _ in cell.streams if to == session) for session in "ab"}
    assert 49 <= counts["a"] <= 51
    assert counts["b"] <= 2, "nothing changes while the arm stands"
    assert cell.ask("a", command="stopStreamStatus")["message"] is True
    before = len(cell.streams)
    cell.advance(0.5)
    assert len(cell.streams) == before
    _, packet = cell.streams[0]
    assert packet["replyCommand"] == "streamStatus" and len(packet["message"]["jointPositions"]["value"]) == 6


def test_stops_have_their_own_way() -> None:
    cell = PerfectArm()
    begin(cell, "path")
    cell.advance(0.2)
    ticket = cell.send("b", '{"command":"softStop","id":3}', stop=True)
    assert cell.answers[ticket]["message"]["value"] is True
    ticket = cell.send("b", '{"command":"getStatus","id":4}', stop=True)
    assert cell.answers[ticket] == {
        "command": "reply", "replyCommand": "error", "message": "Unknown command: getStatus", "id": 4,
        "text": "only softStop and hardStop are accepted here",
    }  # fmt: skip
    cell.until_rest(1.0)


def test_profiles_change_what_is_appended_afterwards() -> None:
    cell = PerfectArm()
    cell.ok("a", command="setProfileVelocity", type="joints", data=[0.2] * 6)
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 0.4))
    cell.until_rest()
    _, dq = cell.driven()
    assert 0.195 < np.abs(dq).max() <= 0.2001
    configuration = cell.ask("a", command="getConfiguration")["message"]
    assert configuration["ProfileParameters"]["JointVelocities"] == [0.2] * 6
    answer = cell.ask("a", command="setProfileVelocity", priority=10, type="joints", data=[50.0] * 6)
    assert answer["message"]["value"] is True and "bounded" in answer["text"]


def test_a_posture_is_drawn_to_while_the_tool_keeps_its_path() -> None:
    cell = PerfectArm(FR3)
    start = cell.tool()
    wanted = FR3.home.copy()
    wanted[2] += 0.6
    cell.ok(
        "a",
        command="setParameters",
        data={
            "Controller": {
                "DesiredJointPosition": {"AttractionPosition": ["NaN", "NaN", wanted[2], "NaN", "NaN", "NaN", "NaN"]},
                "ObjectiveFunctions": {"DesiredJointPositions": {"enable": True, "c": 2.0, "blend": 0.2}},
            }
        },
    )
    target = moved(start, 0.0, 0.05, 0.05)
    cell.ok("a", command="setProfileVelocity", type="task", data=[0.05] * 3 + [1.0] * 3)
    cell.ok("a", command="appendPath", type="task", data=[pose(target)], method=2, reference=1)
    cell.until_rest()
    assert np.abs(cell.tool() - target).max() < 1e-3
    assert abs(cell.q[2] - wanted[2]) < 0.45
    cell.check_limits()
    cell.ok("a", command="appendPath", type="joints", data=joints(FR3, 0.0))
    cell.until_rest()
    assert np.abs(cell.q - FR3.home).max() < 1e-9
    cell.check_limits()


def test_bad_parameters_change_nothing() -> None:
    cell = PerfectArm()
    before = cell.controller.motion.solver.ik.objectives.state()
    for functions in (
        {"JointLimits": {"enable": True}, "Manipulability": {"enable": True, "p": 1.0}},
        {"CollisionAvoidanceSphere": {"enable": True}},
    ):
        answer = cell.ask(
            "a", command="setParameters", priority=10, data={"Controller": {"ObjectiveFunctions": functions}}
        )
        assert answer["message"] == BAD
    assert not cell.controller.motion.tuning.shapes_paths
    assert cell.controller.motion.solver.ik.objectives.state() == before


def test_the_seed_of_inverse_kinematics_is_the_current_position() -> None:
    cell = PerfectArm()
    seed = {"Controller": {"UpdateJointsInitialPosition": UR5E.home.tolist()}}
    answer = cell.ask("a", command="setParameters", priority=10, data=seed)
    assert answer["message"]["code"] == CrfCode.NotImplemented
    assert "starts from the present joint positions" in answer["text"]


def test_a_sphere_is_not_entered() -> None:
    cell = PerfectArm()
    tip = cell.tool()[:, 3]
    center = (tip + np.array([0.0, 0.3, 0.0])).tolist()
    sphere = {"enable": True, "center": center, "radius": 0.1, "blend": 0.0}
    cell.ok(
        "a",
        command="setParameters",
        data={"Controller": {"ObjectiveFunctions": {"CollisionAvoidanceSphere": sphere}}},
    )
    for _ in range(100):
        cell.ok("a", command="setVelocity", type="task", data=[0, 0.2, 0, 0, 0, 0], reference=1)
        cell.advance(0.04)
    q, _ = cell.driven()
    gaps = [np.linalg.norm(cell.tool(each)[:, 3] - center) for each in q]
    assert min(gaps) > 0.1
    assert min(gaps) < 0.25, "it came near"
    cell.check_limits()


def test_a_stop_condition_stops_the_arm() -> None:
    cell = PerfectArm()
    conditions = {"StopOnLowManipulability": True}
    cell.ok("a", command="setParameters", data={"Controller": {"StopConditions": conditions}})
    straight = UR5E.home.copy()
    straight[4] = 0.02
    cell.ok("a", command="appendPath", type="joints", data=[straight.tolist()])
    cell.until_rest()
    answer: dict[str, Any] = {}
    for _ in range(10):
        answer = cell.ask("a", command="setVelocity", priority=10, type="task", data=[0.05] * 6, reference=1)
        cell.advance(0.04)
    assert answer["message"]["code"] == CrfCode.LowManipulability


def test_every_request_is_answered_once_when_a_stop_drops_its_plan() -> None:
    cell = PerfectArm()
    begin(cell, "velocity")
    cell.advance(0.04)
    text = json.dumps({"command": "appendPath", "priority": 10, "type": "joints", "data": joints(UR5E, 0.1), "id": 5})
    first, again = cell.send("a", text), cell.send("a", text)
    cell.ask("a", command="softStop")
    cell.until_rest()
    assert first in cell.answers and cell.answers[first] == cell.answers[again]
    assert cell.errors == []
    cell.advance(1.0)
    assert np.abs(cell.q - UR5E.home).max() < 0.05, "the plan is not driven after all"


def test_who_has_arrived_has_left_nothing_running() -> None:
    cell = PerfectArm()
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 0.1))
    cell.until_rest()
    assert cell.ask("a", command="unlockControl", priority=10)["message"] is True
    cell.controller.disconnected("a")
    cell.advance(0.01)
    assert [entry.action for entry in cell.audit] == ["grant", "unlockControl"]


def test_who_vanishes_on_the_way_is_stopped() -> None:
    cell = PerfectArm()
    cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 1.0))
    cell.advance(0.2)
    cell.controller.disconnected("a")
    assert cell.until_rest() < 0.5
    assert cell.q[0] < UR5E.home[0] + 0.9


def test_the_same_commands_give_the_same_motion() -> None:
    def run() -> Array:
        cell = PerfectArm()
        begin(cell, "path")
        cell.advance(0.3)
        begin(cell, "task velocity")
        cell.advance(0.4)
        cell.ok("a", command="appendPath", type="joints", data=joints(UR5E, 0.1))
        cell.until_rest()
        return cell.driven()[0]

    assert np.array_equal(run(), run())


def test_the_way_of_the_tool_is_reported_when_it_changes() -> None:
    cell = PerfectArm()
    cell.controller.poll()
    cell.advance(0.1)
    assert [len(path.points) for path in cell.paths] == [0]
    goal = UR5E.home + 0.3
    cell.ok("a", command="appendPath", type="joints", data=[goal.tolist()])
    cell.advance(0.1)
    cell.controller.poll()
    cell.advance(0.1)
    assert len(cell.paths) == 2
    assert np.allclose(cell.paths[1].points[-1], cell.tool(goal)[:, 3], atol=1e-5)
    cell.until_rest()
    cell.controller.poll()
    cell.advance(0.1)
    assert [len(path.points) for path in cell.paths[2:]] == [0]


def test_diagnostics_tell_how_far_the_arm_is_from_where_it_was_asked_to_be() -> None:
    cell = PerfectArm()
    cell.advance(0.1)
    assert cell.diagnostics is not None
    assert np.abs(cell.diagnostics.joint_errors).max() < 1e-12 and cell.diagnostics.linear_error < 1e-12
    cell.q[0] += 0.01
    cell.stamp += PERIOD_NS  # a tick is skipped
    for _ in range(12):
        cell.stamp += PERIOD_NS
        cell.tick()
    told = cell.diagnostics
    assert np.allclose(told.joint_errors, [0.01, 0, 0, 0, 0, 0])
    reach = np.hypot(*cell.tool(UR5E.home)[:2, 3])
    assert told.linear_error == pytest.approx(2 * reach * np.sin(0.005), rel=1e-6)
    assert told.angular_error == pytest.approx(0.01, rel=1e-6)
    assert told.late_ticks == 1
    assert (told.tick_us, told.solver_us) == (0.0, 0.0), "nobody measures"


def test_diagnostics_count_what_the_solver_does_and_how_long_it_takes() -> None:
    cell = PerfectArm(stopwatch=iter(range(0, 10**9, 1000)).__next__)
    cell.ok("a", command="setVelocity", type="task", data=[0.05, 0, 0, 0, 0, 0], reference=1)
    cell.advance(0.08)
    assert cell.diagnostics is not None
    assert cell.diagnostics.solver_iterations == 1
    assert (cell.diagnostics.solver_us, cell.diagnostics.tick_us) == (1.0, 3.0), (
        "the solver's two looks are in the tick"
    )


def test_what_a_released_lock_has_set_in_motion_arrives_though_another_waits() -> None:
    cell = PerfectArm()
    path = {"command": "appendPath", "type": "joints", "data": joints(UR5E, 0.4)}
    assert cell.ask("low", command="lockControl", priority=20)["message"] is True
    cell.ok("high", priority=5, **path)
    assert cell.ask("high", command="unlockControl", priority=5)["message"] is True
    assert cell.get_status()["holder"]["priority"] == 20
    for _ in range(8):
        assert cell.ask("low", command="lockControl", priority=20)["message"] is True
        cell.advance(0.4)
    assert np.abs(cell.q - UR5E.home - 0.4).max() < 1e-9
