"""The arm's model: pinocchio's and the kernels' equal to MuJoCo's, also inside a cell, and bad descriptions refused."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from rackhand.services.controller.ik import Arm, ArmError, build_arm, forward, load_arm
from rackhand.services.controller.ik import kernels as k
from rackhand.worlds.arm_model import ArmDescription, arm_mjcf, load_arm_description


def spec_of(name: str) -> mujoco.MjSpec:
    return mujoco.MjSpec.from_file(str(arm_mjcf(name)))


def in_a_cell(name: str) -> mujoco.MjModel:
    """The arm on a turned pedestal, a gripper on its flange, beside a loose box."""
    world = mujoco.MjSpec()
    pedestal = world.worldbody.add_body(pos=[1.0, -2.0, 0.6], quat=[0.8, 0.2, -0.1, 0.55])
    site = pedestal.add_frame(pos=[0.0, 0.1, 0.2])
    box = world.worldbody.add_body(name="box", pos=[3, 0, 1])
    box.add_freejoint()
    box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.1, 0.1, 0.1])
    arm = spec_of(name)
    flange = next(s for s in arm.sites if s.name == "flange")
    gripper = flange.parent.add_body(name="gripper", pos=flange.pos, quat=[0.9, 0.1, 0.3, 0.2])
    gripper.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=[0.02, 0.05, 0], pos=[0, 0, 0.05], mass=0.7)
    gripper.add_site(name="tcp", pos=[0.01, 0.02, 0.12], quat=[0.7, 0.1, 0.6, 0.2])
    site.attach_body(arm.worldbody.first_body(), "arm1/", "")
    return world.compile()


@pytest.mark.parametrize("name", ["ur5e", "fr3"])
@pytest.mark.parametrize("cell", [False, True])
def test_model_equals_mujoco(name: str, cell: bool) -> None:
    compiled = in_a_cell(name) if cell else spec_of(name).compile()
    prefix, tool = ("arm1/", "tcp") if cell else ("", "flange")
    arm = load_arm(name, compiled, prefix, tool)
    data, ours = mujoco.MjData(compiled), arm.model.createData()
    rows = [compiled.joint(joint).dofadr[0] for joint in arm.joints]
    seats = [compiled.joint(joint).qposadr[0] for joint in arm.joints]
    base, site = data.body(prefix + load_arm_description(name).base), data.site(prefix + tool)
    random = np.random.default_rng(5)
    for _ in range(20):
        q, v = random.uniform(arm.limits.lower, arm.limits.upper), random.uniform(-2, 2, arm.n)
        data.qpos[seats], data.qvel[rows] = q, v
        mujoco.mj_forward(compiled, data)
        turn = base.xmat.reshape(3, 3)
        pin.forwardKinematics(arm.model, ours, q)
        pin.updateFramePlacements(arm.model, ours)
        for i, frame in enumerate(arm.model.frames):
            if frame.type == pin.FrameType.BODY:
                body = data.body(frame.name)
                np.testing.assert_allclose(turn @ ours.oMf[i].translation + base.xpos, body.xpos, atol=1e-10)
                np.testing.assert_allclose(turn @ ours.oMf[i].rotation, body.xmat.reshape(3, 3), atol=1e-10)
        pose = forward(arm, q)
        np.testing.assert_allclose(turn @ pose[:, 3] + base.xpos, site.xpos, atol=1e-10)
        np.testing.assert_allclose(turn @ pose[:, :3], site.xmat.reshape(3, 3), atol=1e-10)
        linear, angular = np.zeros((3, compiled.nv)), np.zeros((3, compiled.nv))
        mujoco.mj_jacSite(compiled, data, linear, angular, site.id)
        expected = np.vstack([linear, angular])[:, rows]
        frame_id = arm.model.getFrameId(prefix + tool)
        local = pin.computeFrameJacobian(arm.model, ours, q, frame_id, pin.LOCAL)
        to_world = np.kron(np.eye(2), turn @ pose[:, :3])
        np.testing.assert_allclose(to_world @ local, expected, atol=1e-10)
        frames, kernel = np.empty((arm.n + 1, 3, 4)), np.empty((6, arm.n))
        k.forward(arm.placements, q, frames)
        k.jacobian(frames, kernel)
        np.testing.assert_allclose(kernel, local, atol=1e-12)
        np.testing.assert_allclose(pin.nonLinearEffects(arm.model, ours, q, v), data.qfrc_bias[rows], atol=1e-10)
        full = np.zeros((compiled.nv, compiled.nv))
        mujoco.mj_fullM(compiled, data, full)
        np.testing.assert_allclose(pin.crba(arm.model, ours, q), full[np.ix_(rows, rows)], atol=1e-10)


def test_axis_need_not_be_z() -> None:
    xml = """<mujoco><compiler angle="radian"/><worldbody><body name="base"><body pos="0 0 .3" quat=".9 .1 .2 .3">
      <joint name="a" axis="1 2 -1" range="-2 2" pos=".1 .2 .3"/><geom size=".1"/><body pos=".4 0 .1">
      <joint name="b" axis="0 -1 0" range="-2 2"/><geom size=".1"/><site name="tool" pos=".1 .2 .3"/></body></body>
      </body></worldbody></mujoco>"""
    compiled = mujoco.MjModel.from_xml_string(xml)
    two = {
        key: [1.0, 1.0] for key in ("velocity", "acceleration", "jerk", "task_velocity", "task_acceleration", "home")
    }
    arm = build_arm("two", compiled, ArmDescription.model_validate(two | {"base": "base", "tool": "tool"}))
    data = mujoco.MjData(compiled)
    data.qpos[:] = [0.7, -1.1]
    mujoco.mj_forward(compiled, data)
    np.testing.assert_allclose(forward(arm, data.qpos)[:, 3], data.site("tool").xpos, atol=1e-12)


def test_published_reach() -> None:
    """UR5e stretched out: the data sheet's 850 mm are measured to the last wrist; FR3's, 855 mm, likewise."""
    ur5e, fr3 = load_arm("ur5e"), load_arm("fr3")
    assert abs(forward(ur5e, np.zeros(6))[0, 3] + 0.425 + 0.3922) < 1e-12
    assert abs(forward(fr3, np.array([0, 0, 0, 0, 0, 0, 0.0]))[2, 3] - (0.333 + 0.316 + 0.384 - 0.107)) < 1e-12


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"base": "nobody"}, "no body 'nobody'"),
        ({"tool": "nothing"}, "no body or site 'nothing'"),
        ({"home": [9.0, 0, 0, 0, 0, 0]}, "is not within the joint ranges"),
        (
            {key: [1.0] * 5 for key in ("home", "velocity", "acceleration", "jerk")},
            "home has 5 .*, the MJCF has 6 joints",
        ),
        (
            {"spheres": [{"name": "s", "body": "b", "at": [0, 0, 0], "radius": 1}], "self_collision": []},
            "'b' of the arm",
        ),
        ({"tool": "forearm_link"}, "is not attached to the last joint"),
    ],
)
def test_a_description_that_does_not_fit_the_mjcf_is_refused(change: dict, says: str) -> None:
    described = ArmDescription.model_validate(load_arm_description("ur5e").model_dump() | change)
    with pytest.raises(ArmError, match=says):
        build_arm("ur5e", spec_of("ur5e").compile(), described)


def test_unknown_arm_lists_the_known() -> None:
    with pytest.raises(ArmError, match=r"known: \[\'fr3\', \'ur5e\'\]"):
        load_arm("ur6")


def test_spheres_follow_their_links(arm: Arm) -> None:
    compiled = spec_of(arm.name).compile()
    data = mujoco.MjData(compiled)
    data.qpos[:] = arm.home
    mujoco.mj_forward(compiled, data)
    frames = np.empty((arm.n + 1, 3, 4))
    k.forward(arm.placements, arm.home, frames)
    for sphere, entry in zip(arm.spheres, load_arm_description(arm.name).spheres, strict=True):
        body = data.body(entry.body)
        frame = np.eye(3, 4) if sphere.joint < 0 else frames[sphere.joint]
        expected = body.xpos + body.xmat.reshape(3, 3) @ np.array(entry.at)
        np.testing.assert_allclose(frame[:, :3] @ sphere.center + frame[:, 3], expected, atol=1e-12)
