"""The doors of a lift in physics: at each floor two leaves of the cabin and two of the shaft, on slides.

Names of the leaves, their joints and actuators are ``lift/floor/leaf``. A joint is 0 closed and half the door's width
open.
"""

from __future__ import annotations

from typing import Any

import mujoco

from rackhand.schemas.planar import compose, yaw_quaternion
from rackhand.services.sim.mjcf import layers
from rackhand.worlds.world_model import Lift

CABIN_DOOR_BEHIND = 0.12  # m from the shaft's door to that of the cabin, inwards
LEAVES = ("shaft_left", "shaft_right", "cabin_left", "cabin_right")
THICKNESS, HEIGHT, MASS = 0.05, 2.0, 40.0
STIFFNESS, FORCE = 20000.0, 150.0  # N/m, and N at most: what a door presses with
_COLOUR = [0.75, 0.72, 0.4, 1]


def leaf_name(lift: str, floor: str, leaf: str) -> str:
    return f"{lift}/{floor}/{leaf}"


def add_lift(spec: Any, name: str, lift: Lift) -> None:
    for floor, pose in lift.floors.items():
        for leaf in LEAVES:
            side = 1 if leaf.endswith("left") else -1
            ahead = lift.door_at - (CABIN_DOOR_BEHIND if leaf.startswith("cabin") else 0.0)
            x, y, yaw = compose(pose, (ahead, side * lift.door / 4, 0.0))
            _add_leaf(spec, leaf_name(name, floor, leaf), (x, y, yaw), side, lift.door / 2)


def _add_leaf(spec: Any, name: str, pose: tuple[float, float, float], side: int, width: float) -> None:
    x, y, yaw = pose
    body = spec.worldbody.add_body(name=name, pos=[x, y, HEIGHT / 2], quat=yaw_quaternion(yaw))
    body.sleep = mujoco.mjtSleepPolicy.mjSLEEP_INIT  # who moves it must wake it: its actuator does not
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, side, 0], damping=[200, 0, 0])
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[THICKNESS / 2, width / 2, HEIGHT / 2],
        mass=MASS,
        rgba=_COLOUR,
        contype=layers.STATIC.contype,
        conaffinity=layers.STATIC.conaffinity,
        group=layers.STATIC.group,
    )
    motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.set_to_position(STIFFNESS, dampratio=1.0)
    motor.forcelimited, motor.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, [-FORCE, FORCE]
