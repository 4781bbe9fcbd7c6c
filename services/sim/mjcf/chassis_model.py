"""A chassis in physics: a free body on two driven wheels and casters, with a lidar's and an IMU's place, and a jack."""

from __future__ import annotations

import math
from typing import Any

import mujoco

from rackhand.services.sim.mjcf import layers
from rackhand.services.sim.mjcf.layers import Layer
from rackhand.worlds.chassis_model import ChassisProfile, JackKind
from rackhand.worlds.data import PoseTuple

_BODY_COLOUR = [0.93, 0.93, 0.95, 1]
_DARK = [0.15, 0.15, 0.17, 1]
WHEELS = ("wheel_left", "wheel_right")
JACK_ARMATURE, JACK_DAMPING, JACK_STIFFNESS = 200.0, 2000.0, 2e6
BEARS = 4.0  # times what its motor lifts: the spindle is self-locking


def add_chassis(spec: Any, robot: str, profile: ChassisProfile, pose: PoseTuple) -> None:
    """Add the chassis ``robot`` standing at ``pose``. Names of its parts are ``robot/part``; its base is ``robot``."""
    x, y, yaw = pose
    base = spec.worldbody.add_body(
        name=robot,
        pos=[x, y, 0],
        quat=[math.cos(yaw / 2), 0, 0, math.sin(yaw / 2)],
        sleep=mujoco.mjtSleepPolicy.mjSLEEP_NEVER,
    )
    base.add_freejoint(name=f"{robot}/free")
    _add_hull(base, robot, profile)
    _add_wheels(spec, base, robot, profile)
    _add_casters(base, robot, profile)
    if profile.jack is not None:
        _add_jack(spec, base, robot, profile, profile.jack)
    _add_imu(spec, base, robot)


def _geom(body: Any, layer: Layer, **options: Any) -> Any:
    return body.add_geom(contype=layer.contype, conaffinity=layer.conaffinity, group=layer.group, **options)


def _add_hull(base: Any, robot: str, profile: ChassisProfile) -> None:
    length, width, height = profile.body.size
    _geom(
        base,
        layers.HULL,
        name=f"{robot}/hull",
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[length / 2, width / 2, height / 2],
        pos=[*profile.body.centre, profile.body.clearance + height / 2],
        mass=profile.body.mass,
        friction=[0.4, 0.005, 0.0001],
        rgba=_BODY_COLOUR,
    )


def _add_wheels(spec: Any, base: Any, robot: str, profile: ChassisProfile) -> None:
    """Wheels collide as spheres, drawn as cylinders: a flat cylinder touches at both rims and scrubs in turns."""
    drive = profile.drive
    for side, part in zip((1, -1), WHEELS, strict=True):
        name = f"{robot}/{part}"
        wheel = base.add_body(name=name, pos=[0, side * drive.wheel_separation / 2, drive.wheel_radius])
        wheel.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], armature=drive.rotor_inertia)
        _geom(
            wheel,
            layers.RUNNING_GEAR,
            name=name,
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[drive.wheel_radius, 0, 0],
            mass=drive.wheel_mass,
            friction=[drive.friction, 0.005, 0.0001],
            priority=1,
            rgba=[0, 0, 0, 0],
        )
        half = math.sqrt(0.5)
        _geom(
            wheel,
            layers.DRAWN_ONLY,
            name=f"{name}/drawn",
            type=mujoco.mjtGeom.mjGEOM_CYLINDER,
            size=[drive.wheel_radius, drive.wheel_width / 2, 0],
            quat=[half, half, 0, 0],
            mass=0,
            rgba=_DARK,
        )
        motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_velocity(drive.gain)
        motor.forcelimited, motor.forcerange = mujoco.mjtLimited.mjLIMITED_TRUE, [-drive.torque, drive.torque]


def _add_casters(base: Any, robot: str, profile: ChassisProfile) -> None:
    """Frictionless spheres. They are softer than the wheels, so that the wheels bear most of the weight."""
    radius = profile.casters.radius
    for i, (x, y) in enumerate(profile.casters.positions):
        _geom(
            base,
            layers.RUNNING_GEAR,
            name=f"{robot}/caster{i}",
            type=mujoco.mjtGeom.mjGEOM_SPHERE,
            size=[radius, 0, 0],
            pos=[x, y, radius],
            mass=0.2,
            condim=1,
            priority=1,  # or the floor's friction would hold them
            solref=[0.03, 1],
            rgba=_DARK,
        )


def _add_jack(spec: Any, base: Any, robot: str, profile: ChassisProfile, jack: JackKind) -> None:
    name = f"{robot}/jack"
    top = profile.body.clearance + profile.body.size[2]
    length, width, height = jack.plate
    plate = base.add_body(name=name, pos=[0, 0, top + height / 2])
    plate.add_joint(
        name=name,
        type=mujoco.mjtJoint.mjJNT_SLIDE,
        axis=[0, 0, 1],
        armature=JACK_ARMATURE,
        damping=[JACK_DAMPING, 0, 0],
    )
    _geom(
        plate,
        layers.PLATE,
        name=name,
        type=mujoco.mjtGeom.mjGEOM_BOX,
        size=[length / 2, width / 2, height / 2],
        mass=jack.mass,
        friction=[jack.friction, 0.005, 0.0001],
        priority=1,  # or the greater friction of the two would hold
        rgba=_DARK,
    )
    spindle = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    spindle.set_to_position(JACK_STIFFNESS, dampratio=1.0)
    spindle.forcelimited, spindle.forcerange = (
        mujoco.mjtLimited.mjLIMITED_TRUE,
        [-BEARS * jack.force, BEARS * jack.force],
    )


def _add_imu(spec: Any, base: Any, robot: str) -> None:
    site = f"{robot}/imu"
    base.add_site(name=site, pos=[0, 0, 0.1])
    for kind in ("gyro", "accelerometer"):
        sensor = spec.add_sensor(name=f"{robot}/{kind}", objname=site, objtype=mujoco.mjtObj.mjOBJ_SITE)
        sensor.type = {"gyro": mujoco.mjtSensor.mjSENS_GYRO, "accelerometer": mujoco.mjtSensor.mjSENS_ACCELEROMETER}[
            kind
        ]
