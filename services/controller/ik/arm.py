"""An arm as the solver needs it: pinocchio's model, built from the *compiled* MuJoCo model, and its limits.

The compiled model is read because it is what the simulator steps; pinocchio's own MJCF parser (4.1) drops the pose of a
fixed root body and knows no velocity limits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rackhand.services.controller.ik.solids import Solid, link_solids
from rackhand.worlds.arm_model import ArmDescription, LinkSphere, arm_mjcf, load_arm_description
from rackhand.worlds.data import WorldFileError

if TYPE_CHECKING:
    import mujoco

Array = NDArray[np.float64]


class ArmError(ValueError):
    """A description that does not give an arm; the text says what, where, and what was expected."""


@dataclass(frozen=True)
class ArmLimits:
    """Joint limits, each of shape (n,): rad, rad/s, rad/s², rad/s³, Nm; and the task's as (linear, angular) pairs."""

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array
    torque: Array
    task_velocity: tuple[float, float]
    task_acceleration: tuple[float, float]


@dataclass(frozen=True)
class Sphere:
    """A sphere that approximates a part of a link: fixed in the frame of joint number ``joint`` (-1 is the base)."""

    name: str
    joint: int
    center: Array
    radius: float


@dataclass(frozen=True)
class Arm:
    """A serial arm of n revolute joints.

    ``model`` is pinocchio's (for dynamics), its universe is the base frame. ``placements`` (n+1, 3, 4) is the same
    kinematics as the kernels read it: pose of each joint in the one before, turned so that every axis is z, and of
    the tool in the last. ``solids`` are its parts, ``surroundings`` what they must not touch (``in_station``).
    """

    name: str
    model: pin.Model
    placements: Array
    joints: tuple[str, ...]
    limits: ArmLimits
    home: Array
    spheres: tuple[Sphere, ...]
    self_collision: tuple[tuple[int, int], ...]
    solids: tuple[Solid, ...] = ()
    surroundings: tuple[Solid, ...] = ()

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)


def load_arm(name: str, compiled: mujoco.MjModel | None = None, prefix: str = "", tool: str | None = None) -> Arm:
    """The arm ``name`` of the worlds folders (``arms/<name>.yaml`` and ``arms/<name>.xml``).

    With ``compiled``, kinematics and inertias are read from that model (a cell, where the arm's names carry ``prefix``
    and a gripper may hang on the flange) instead of from the arm's own MJCF. ``tool`` is the site or body to command
    (the flange). Raises ``ArmError``.
    """
    try:
        description, mjcf = load_arm_description(name), arm_mjcf(name)
    except WorldFileError as error:
        raise ArmError(str(error)) from None
    if compiled is None:
        import mujoco  # only where a model is read: everything else of this package does without

        compiled = mujoco.MjModel.from_xml_path(str(mjcf))
    return build_arm(name, compiled, description.model_copy(update={"tool": tool or description.tool}), prefix)


def build_arm(name: str, compiled: mujoco.MjModel, description: ArmDescription, prefix: str = "") -> Arm:
    """The arm in a compiled model, ``description`` giving what an MJCF cannot say."""
    model = from_mujoco(compiled, prefix + description.base)
    tool = model.getFrameId(prefix + description.tool)
    if tool >= model.nframes:
        raise ArmError(
            f"{name}: no body or site {prefix + description.tool!r} below body {prefix + description.base!r}"
        )
    placements, turns = _chain(model, tool)
    if len(description.home) != model.nv:
        raise ArmError(f"{name}: home has {len(description.home)} joint positions, the MJCF has {model.nv} joints")
    limits = ArmLimits(
        model.lowerPositionLimit.copy(),
        model.upperPositionLimit.copy(),
        np.array(description.velocity),
        np.array(description.acceleration),
        np.array(description.jerk),
        model.upperEffortLimit.copy(),
        description.task_velocity,
        description.task_acceleration,
    )
    home = np.array(description.home)
    if np.any(home < limits.lower) or np.any(home > limits.upper):
        raise ArmError(f"{name}: home {home.tolist()} is not within the joint ranges of the MJCF")
    spheres = tuple(_sphere(model, turns, prefix, sphere, name) for sphere in description.spheres)
    index = {sphere.name: i for i, sphere in enumerate(spheres)}
    pairs = tuple((index[a], index[b]) for a, b in description.self_collision)
    solids = link_solids(model, compiled, prefix)
    return Arm(name, model, placements, tuple(model.names)[1:], limits, home, spheres, pairs, solids)


def from_mujoco(compiled: mujoco.MjModel, base: str) -> pin.Model:
    """Pinocchio's model of the bodies below ``base`` of a compiled MuJoCo model, in the frame of ``base``.

    Hinges and slides become joints of the same names, bodies and sites frames; inertias, rotor inertias, joint ranges
    and force limits are taken over. Frames, Jacobians, bias forces and mass matrix equal MuJoCo's to rounding.
    """
    ids = {compiled.body(i).name: i for i in range(compiled.nbody)}
    if base not in ids:
        raise ArmError(f"no body {base!r} in the compiled model")
    root = ids[base]
    model = pin.Model()
    model.name = base
    model.gravity.linear = _rest_pose(compiled, root).rotation.T @ compiled.opt.gravity
    joint_of: dict[int, tuple[int, pin.SE3]] = {root: (0, pin.SE3.Identity())}
    for body in range(root + 1, compiled.nbody):
        if int(compiled.body_parentid[body]) not in joint_of:
            continue
        parent, placement = joint_of[int(compiled.body_parentid[body])]
        placement = placement * _pose(compiled.body_pos[body], compiled.body_quat[body])
        for joint in range(compiled.body_jntadr[body], compiled.body_jntadr[body] + compiled.body_jntnum[body]):
            parent = _add_joint(model, compiled, joint, parent, placement)
            # The body's frame stands off the joint's by the anchor, in which MuJoCo turns it.
            placement = pin.SE3(np.eye(3), -compiled.jnt_pos[joint])
        joint_of[body] = (parent, placement)
        inertia = pin.Inertia(compiled.body_mass[body], np.zeros(3), np.diag(compiled.body_inertia[body]))
        centre = placement * _pose(compiled.body_ipos[body], compiled.body_iquat[body])
        model.appendBodyToJoint(parent, inertia, centre)
    for body, (joint, placement) in joint_of.items():
        model.addFrame(pin.Frame(compiled.body(body).name, joint, placement, pin.FrameType.BODY), False)
    for site in range(compiled.nsite):
        if (body := int(compiled.site_bodyid[site])) in joint_of:
            joint, placement = joint_of[body]
            pose = placement * _pose(compiled.site_pos[site], compiled.site_quat[site])
            model.addFrame(pin.Frame(compiled.site(site).name, joint, pose, pin.FrameType.OP_FRAME), False)
    return model


def _add_joint(model: pin.Model, compiled: mujoco.MjModel, joint: int, parent: int, placement: pin.SE3) -> int:
    kind, axis = int(compiled.jnt_type[joint]), compiled.jnt_axis[joint].copy()
    name = compiled.joint(joint).name
    if kind not in (2, 3):  # mjJNT_SLIDE, mjJNT_HINGE
        raise ArmError(f"joint {name!r} must be a hinge or a slide joint")
    maker = pin.JointModelRevoluteUnaligned if kind == 3 else pin.JointModelPrismaticUnaligned
    pose = placement * pin.SE3(np.eye(3), compiled.jnt_pos[joint].copy())
    added: int = model.addJoint(parent, maker(axis), pose, name)
    position, velocity = model.joints[added].idx_q, model.joints[added].idx_v
    limited = bool(compiled.jnt_limited[joint])
    low, high = compiled.jnt_range[joint] if limited else (-np.inf, np.inf)
    model.lowerPositionLimit[position], model.upperPositionLimit[position] = low, high
    model.armature[velocity] = compiled.dof_armature[compiled.jnt_dofadr[joint]]
    model.damping[velocity] = compiled.dof_damping[compiled.jnt_dofadr[joint]]
    torque = compiled.jnt_actfrcrange[joint] if compiled.jnt_actfrclimited[joint] else (-np.inf, np.inf)
    model.lowerEffortLimit[velocity], model.upperEffortLimit[velocity] = torque
    return added


def _chain(model: pin.Model, tool: int) -> tuple[Array, list[Array]]:
    """Placements as ``Arm`` has them, and per joint the rotation that turns its axis to z (``turns[0]``: the base)."""
    parents, kinds = list(model.parents)[1:], [model.joints[j].shortname() for j in range(1, model.njoints)]
    if parents != list(range(model.nv)) or any("Revolute" not in kind for kind in kinds) or model.nv == 0:
        raise ArmError(f"{model.name}: a serial chain of revolute joints was expected, found {kinds} on {parents}")
    if model.frames[tool].parentJoint != model.nv:
        raise ArmError(f"{model.name}: tool {model.frames[tool].name!r} is not attached to the last joint")
    z = np.array([0.0, 0.0, 1.0])
    turns = [np.eye(3)]
    for joint in range(1, model.njoints):
        # The axis is what the joint's spatial velocity is for unit speed.
        data = model.joints[joint].createData()
        model.joints[joint].calc(data, pin.neutral(model), np.ones(model.nv))
        axis = data.S[3:, 0] if np.ndim(data.S) == 2 else data.S[3:]
        turns.append(np.asarray(pin.Quaternion.FromTwoVectors(z, np.asarray(axis).ravel()).matrix()))
    poses = [*list(model.jointPlacements)[1:], model.frames[tool].placement]
    ends = [*turns[1:], np.eye(3)]
    placements = np.empty((model.nv + 1, 3, 4))
    for i, (pose, end) in enumerate(zip(poses, ends, strict=True)):
        placements[i, :, :3] = turns[i].T @ pose.rotation @ end
        placements[i, :, 3] = turns[i].T @ pose.translation
    return placements, turns


def _sphere(model: pin.Model, turns: list[Array], prefix: str, sphere: LinkSphere, name: str) -> Sphere:
    frame = model.getFrameId(prefix + sphere.body)
    if frame >= model.nframes:
        raise ArmError(f"{name}: sphere {sphere.name!r} names no body {prefix + sphere.body!r} of the arm")
    joint = model.frames[frame].parentJoint
    center = turns[joint].T @ model.frames[frame].placement.act(np.array(sphere.at))
    return Sphere(sphere.name, joint - 1, center, sphere.radius)


def _pose(position: Array, quaternion: Array) -> pin.SE3:
    w, x, y, z = quaternion
    return pin.SE3(pin.Quaternion(w, x, y, z), np.asarray(position, float))


def _rest_pose(compiled: mujoco.MjModel, body: int) -> pin.SE3:
    """Pose of a body in the world, nothing above it having joints."""
    pose = pin.SE3.Identity()
    while body:
        if compiled.body_jntnum[body]:
            raise ArmError(f"base {compiled.body(body).name!r} must be fixed in the world but is attached to a joint")
        pose = _pose(compiled.body_pos[body], compiled.body_quat[body]) * pose
        body = int(compiled.body_parentid[body])
    return pose
