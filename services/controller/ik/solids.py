"""What must not touch: the arm's links as the MJCF has them, the tool it carries, and what stands about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
import pinocchio as pin

from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik.kernels import forward as place_links
from rackhand.worlds.arm_model import GRIPPER_LENGTH, GRIPPER_RADIUS
from rackhand.worlds.solids import static_shapes
from rackhand.worlds.world_model import World

if TYPE_CHECKING:
    import mujoco

    from rackhand.services.controller.ik.arm import Arm

Kind = Literal["sphere", "capsule", "cylinder", "box"]
# mjtGeom: 2 sphere, 3 capsule, 5 cylinder, 6 box.
_KINDS: dict[int, Kind] = {2: "sphere", 3: "capsule", 5: "cylinder", 6: "box"}
_FLOOR = (5.0, 5.0, 0.05)  # m: half sides of the slab that stands for the floor


@dataclass(frozen=True)
class Solid:
    """A shape fixed to joint number ``joint`` (-1: the base), at ``pose`` (3, 4) in the frame of pinocchio's joint.

    ``size`` as MuJoCo has it [m]: radius; radius and half length along z; or three half sides.
    """

    name: str
    joint: int
    pose: Array
    kind: Kind
    size: tuple[float, ...]

    @property
    def radius(self) -> float:
        """Of the sphere about its middle that encloses it [m]."""
        if self.kind == "capsule":
            return self.size[0] + self.size[1]
        return float(np.linalg.norm(self.size))


def link_solids(model: pin.Model, compiled: mujoco.MjModel, prefix: str) -> tuple[Solid, ...]:
    """The colliding primitives of the bodies of ``model``. Meshes and planes are left out."""
    solids = []
    frames = {model.frames[i].name: model.frames[i] for i in range(model.nframes)}
    for i in range(compiled.ngeom):
        body = compiled.body(int(compiled.geom_bodyid[i])).name
        kind = _KINDS.get(int(compiled.geom_type[i]))
        frame = frames.get(body)
        if kind is None or frame is None or not (compiled.geom_contype[i] or compiled.geom_conaffinity[i]):
            continue
        if not body.startswith(prefix):
            continue
        w, x, y, z = compiled.geom_quat[i]
        pose = frame.placement * pin.SE3(pin.Quaternion(w, x, y, z), compiled.geom_pos[i].copy())
        count = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3}[kind]
        size = tuple(float(value) for value in compiled.geom_size[i][:count])
        name = (compiled.geom(i).name or body).removeprefix(prefix)
        solids.append(Solid(name, frame.parentJoint - 1, pose.homogeneous[:3].copy(), kind, size))
    return tuple(solids)


def in_station(arm: Arm, world: World, name: str) -> Arm:
    """The arm with what surrounds it in ``world``, where it is called ``name``: the floor, the statics within its
    reach, and the gripper it carries there. What can be moved is not among them."""
    place = world.arms[name]
    x, y, yaw = place.pose
    base = pin.SE3(pin.utils.rotate("z", yaw), np.array([x, y, place.mount]))
    cup = () if place.gripper is None else (_cup(arm),)
    around = [Solid("floor", -1, _upright(base, (x, y, -_FLOOR[2]), 0.0), "box", _FLOOR)]
    for thing, static in world.statics.items():
        for shape in static_shapes(static):
            size = (shape.a, shape.c) if shape.kind == "cylinder" else (shape.a, shape.b, shape.c)
            pose = _upright(base, (shape.x, shape.y, shape.z), shape.yaw)
            around.append(Solid(thing, -1, pose, shape.kind, size))
    reach = float(levers(arm, (*arm.solids, *cup))[0])
    near = [solid for solid in around if np.linalg.norm(solid.pose[:, 3]) - solid.radius < reach]
    return replace(arm, solids=(*arm.solids, *cup), surroundings=tuple(near))


def levers(arm: Arm, solids: Sequence[Solid]) -> Array:
    """(n,) [m]: no point of the ``solids`` is farther than that from the axis of each joint, in any posture."""
    offsets = np.linalg.norm([pose.translation for pose in arm.model.jointPlacements], axis=1)[1:]
    farthest = np.zeros(arm.n)
    for solid in solids:
        if solid.joint >= 0:
            extent = float(np.linalg.norm(solid.pose[:, 3])) + solid.radius
            farthest[solid.joint] = max(farthest[solid.joint], extent)
    out = farthest.copy()
    for i in range(arm.n - 2, -1, -1):
        out[i] = max(farthest[i], offsets[i + 1] + out[i + 1])
    return out


def _cup(arm: Arm) -> Solid:
    """The suction gripper, along z of the flange."""
    pin.forwardKinematics(arm.model, data := arm.model.createData(), arm.home)
    frames = np.empty((arm.n + 1, 3, 4))
    place_links(arm.placements, arm.home, frames)
    tool = frames[-1]
    flange = data.oMi[arm.n].inverse() * pin.SE3(tool[:, :3], tool[:, 3])
    pose = flange * pin.SE3(np.eye(3), np.array([0.0, 0.0, GRIPPER_LENGTH / 2]))
    return Solid("cup", arm.n - 1, pose.homogeneous[:3].copy(), "cylinder", (GRIPPER_RADIUS, GRIPPER_LENGTH / 2))


def _upright(base: pin.SE3, position: tuple[float, float, float], yaw: float) -> Array:
    """Pose (3, 4) in the base frame of what stands in the world."""
    pose = base.inverse() * pin.SE3(pin.utils.rotate("z", yaw), np.array(position))
    return np.asarray(pose.homogeneous[:3].copy())
