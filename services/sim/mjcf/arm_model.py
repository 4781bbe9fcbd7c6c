"""An arm in physics: its own MJCF on a mount, a force-torque sensor at the flange, and a suction gripper if it has one.

Names of its parts are ``arm/part``, with the part's name in the MJCF.
"""

from __future__ import annotations

import math
from typing import Any

import mujoco

from rackhand.services.sim.mjcf import layers
from rackhand.worlds.arm_model import GRIPPER_LENGTH, GRIPPER_RADIUS, ArmDescription, arm_mjcf
from rackhand.worlds.world_model import ArmPlace

TOOL, CUP, SUCTION, SEAL, FORCE, TORQUE = "tool", "cup", "suction", "seal", "force", "torque"
# The suction gripper's mass (kg). It pulls with at most this force (N) on what it touches.
GRIPPER_MASS, SUCTION_FORCE = 0.4, 60.0
SHEAR_SHARE = 0.5  # of that force which the lip of a sealed cup carries sideways
# Cosine of how far a surface may lean and still seal the cup.
SEALS = 0.9
_GRIPPER_COLOUR = [0.15, 0.15, 0.17, 1]


def add_arm(spec: Any, arm: str, kind: ArmDescription, place: ArmPlace) -> None:
    """Add the arm, its base frame at ``place.pose`` and ``place.mount`` above the floor."""
    x, y, yaw = place.pose
    child = mujoco.MjSpec.from_file(str(arm_mjcf(place.kind)))
    frame = spec.worldbody.add_frame(pos=[x, y, place.mount], quat=[math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)])
    spec.attach(child, frame=frame, prefix=f"{arm}/")
    bodies = [body for body in spec.bodies if body.name.startswith(f"{arm}/")]
    for body in bodies:
        for geom in body.geoms:
            geom.contype, geom.conaffinity, geom.group = layers.ARM.contype, layers.ARM.conaffinity, layers.ARM.group
            geom.solref = [0.005, 1]
    # Its servo works at all times; a sleeping arm would not feel it.
    next(body for body in bodies if body.joints).sleep = mujoco.mjtSleepPolicy.mjSLEEP_NEVER
    _add_tool(spec, arm, spec.site(f"{arm}/{kind.tool}"), place.gripper is not None)


def _add_tool(spec: Any, arm: str, flange: Any, gripper: bool) -> None:
    """A body at the flange, so that the sensor measures what passes through it; weightless without a gripper."""
    tool = flange.parent.add_body(name=f"{arm}/{TOOL}", pos=flange.pos, quat=flange.quat)
    tool.add_site(name=f"{arm}/{TOOL}")
    for name, kind in ((FORCE, mujoco.mjtSensor.mjSENS_FORCE), (TORQUE, mujoco.mjtSensor.mjSENS_TORQUE)):
        sensor = spec.add_sensor(name=f"{arm}/{name}", objname=f"{arm}/{TOOL}", objtype=mujoco.mjtObj.mjOBJ_SITE)
        sensor.type = kind
    if not gripper:
        return
    tool.add_geom(
        name=f"{arm}/{CUP}",
        type=mujoco.mjtGeom.mjGEOM_CYLINDER,
        size=[GRIPPER_RADIUS, GRIPPER_LENGTH / 2, 0],
        pos=[0, 0, GRIPPER_LENGTH / 2],
        mass=GRIPPER_MASS,
        contype=layers.ARM.contype,
        conaffinity=layers.ARM.conaffinity,
        group=layers.ARM.group,
        solref=[0.005, 1],
        rgba=_GRIPPER_COLOUR,
    )
    suction = spec.add_actuator(name=f"{arm}/{SUCTION}", target=f"{arm}/{TOOL}", trntype=mujoco.mjtTrn.mjTRN_BODY)
    suction.set_to_adhesion(SUCTION_FORCE)
    # Attaches what seals the cup; which body that is is set when it does.
    seal = spec.add_equality(name=f"{arm}/{SEAL}", name1=f"{arm}/{TOOL}", name2="world", active=False)
    seal.type, seal.objtype = mujoco.mjtEq.mjEQ_WELD, mujoco.mjtObj.mjOBJ_BODY
    seal.solref = [0.005, 1]
    suction.ctrllimited, suction.ctrlrange = mujoco.mjtLimited.mjLIMITED_TRUE, [0, 1]
