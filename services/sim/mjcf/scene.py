"""A world's data as a MuJoCo model: floor, statics, racks, items, chargers, chassis, slots for what is placed later."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.planar import yaw_quaternion
from rackhand.services.sim.mjcf import layers
from rackhand.services.sim.mjcf.arm_model import add_arm
from rackhand.services.sim.mjcf.chassis_model import add_chassis
from rackhand.services.sim.mjcf.lift_model import add_lift
from rackhand.worlds.arm_model import ArmDescription
from rackhand.worlds.chassis_model import ChassisProfile
from rackhand.worlds.solids import Shape, charger_shapes, static_shapes
from rackhand.worlds.world_model import Item, Rack, RackKind, World

# How many things of each kind can be placed at run time. Slots are compiled in, because recompiling would
# put everything that moves to sleep, and cost some 50 ms.
SLOTS = {"box": 24, "cylinder": 12, "person": 8}
_SLOT_GEOMS = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "person": mujoco.mjtGeom.mjGEOM_CAPSULE,
}
_SLOT_COLOURS = {"box": (0.7, 0.5, 0.3, 1), "cylinder": (0.8, 0.45, 0.2, 1), "person": (0.85, 0.35, 0.35, 1)}
PARKED_Z = -50.0
# Corners of a rack where its legs are: front left, front right, rear left, rear right.
LEGS = ((1, 1), (1, -1), (-1, 1), (-1, -1))
_GEOMS = {
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
}


def build_model(
    world: World, profiles: Mapping[str, ChassisProfile], kinds: Mapping[str, ArmDescription]
) -> mujoco.MjModel:
    """Compile the world. ``profiles``: robot → its profile; ``kinds``: arm → its kind. Raises ``ValueError`` if MuJoCo
    cannot compile it.
    """
    spec = mujoco.MjSpec()
    _set_options(spec, world)
    _add_floor(spec)
    for name, static in world.statics.items():
        for i, shape in enumerate(static_shapes(static)):
            _add_static(spec, f"{name}#{i}", shape)
    for name, charger in world.chargers.items():
        for i, shape in enumerate(charger_shapes(charger)):
            _add_static(spec, f"{name}#{i}", shape)
    for name, lift in world.lifts.items():
        add_lift(spec, name, lift)
    for name, rack in world.racks.items():
        _add_rack(spec, name, rack, world.rack_kinds[rack.kind])
    for name, item in world.items.items():
        _add_item(spec, name, item, world.underside(item), asleep=item.lies_on in world.racks)
    for robot, profile in profiles.items():
        add_chassis(spec, robot, profile, world.robots[robot].pose)
    for arm, arm_kind in kinds.items():
        add_arm(spec, arm, arm_kind, world.arms[arm])
    for kind, count in SLOTS.items():
        for i in range(count):
            _add_slot(spec, kind, i)
    return spec.compile()


def slot_name(kind: str, index: int) -> str:
    return f"slot/{kind}/{index}"


def leg_name(rack: str, leg: int) -> str:
    """Of the geom of a leg, in the order of ``LEGS``."""
    return f"{rack}/leg{leg}"


def leg_place(kind: RackKind, corner: tuple[int, int]) -> NDArray[np.float64]:
    """Middle of the leg at a corner of ``LEGS``, in the rack's frame: x, y."""
    return np.array(corner) * (np.array(kind.size) - kind.leg) / 2


def _set_options(spec: Any, world: World) -> None:
    option = spec.option
    option.timestep = world.timestep
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.impratio = 10
    option.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    spec.default.geom.solref = [0.005, 1]


def _apply(geom: Any, layer: layers.Layer) -> Any:
    geom.contype, geom.conaffinity, geom.group = layer.contype, layer.conaffinity, layer.group
    return geom


def _add_floor(spec: Any) -> None:
    floor = spec.worldbody.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], rgba=[0.85, 0.85, 0.83, 1]
    )
    _apply(floor, layers.FLOOR)


def _add_static(spec: Any, name: str, shape: Shape) -> None:
    geom = spec.worldbody.add_geom(
        name=name,
        type=_GEOMS[shape.kind],
        size=shape.half_sizes,
        pos=[shape.x, shape.y, shape.z],
        quat=yaw_quaternion(shape.yaw),
        rgba=[*shape.colour, 1],
    )
    _apply(geom, layers.STATIC)


def _add_rack(spec: Any, name: str, rack: Rack, kind: RackKind) -> None:
    x, y, yaw = rack.pose
    body = spec.worldbody.add_body(name=name, pos=[x, y, 0], quat=yaw_quaternion(yaw))
    body.add_freejoint()
    body.sleep = mujoco.mjtSleepPolicy.mjSLEEP_INIT  # it wakes by itself when something touches it
    length, width = kind.size
    legs_mass, boards_mass = 0.2 * kind.mass / 4, 0.8 * kind.mass / kind.boards
    colour = [0.25, 0.45, 0.75, 1]
    for i, level in enumerate(kind.levels):
        shelf = body.add_geom(
            name=f"{name}/board{i}",
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[length / 2, width / 2, kind.board / 2],
            pos=[0, 0, level - kind.board / 2],
            mass=boards_mass,
            rgba=colour,
        )
        _apply(shelf, layers.RACK)
    half = kind.leg / 2
    for i, corner in enumerate(LEGS):
        leg = body.add_geom(
            name=leg_name(name, i),
            type=mujoco.mjtGeom.mjGEOM_BOX,
            size=[half, half, kind.height / 2],
            pos=[*leg_place(kind, corner), kind.height / 2],
            mass=legs_mass,
            rgba=colour,
        )
        _apply(leg, layers.RACK)


def _add_item(spec: Any, name: str, item: Item, underside: float, asleep: bool) -> None:
    x, y, yaw = item.pose
    length, width, height = item.size
    body = spec.worldbody.add_body(name=name, pos=[x, y, underside + height / 2], quat=yaw_quaternion(yaw))
    body.add_freejoint()
    if asleep:  # or it would wake the rack that it lies on
        body.sleep = mujoco.mjtSleepPolicy.mjSLEEP_INIT
    geom = body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[length / 2, width / 2, height / 2],
        mass=item.mass,
        rgba=[*item.colour, 1],
        condim=4,  # a cup that holds it by one side holds it against turning, too
        friction=[0.8, 0.02, 0.0001],
    )
    _apply(geom, layers.ITEM)


def _add_slot(spec: Any, kind: str, index: int) -> None:
    """A mocap body under the floor. Its inertia frame is set, so that its bounding box lies along its own axes."""
    name = slot_name(kind, index)
    body = spec.worldbody.add_body(name=name, mocap=True, pos=[2.0 * index, 0, PARKED_Z])
    body.explicitinertial = True
    body.mass, body.inertia = 1.0, [1.0, 1.0, 1.0]
    body.ipos, body.iquat = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]
    geom = body.add_geom(name=name, type=_SLOT_GEOMS[kind], size=[0.2, 0.2, 0.2], rgba=_SLOT_COLOURS[kind])
    _apply(geom, layers.OBSTACLE)
    geom.group = layers.PARKED_GROUP
