"""The drive of a chassis: wheel speeds for the commanded body twist."""

from __future__ import annotations

from dataclasses import dataclass

from rackhand.schemas.base import Twist2
from rackhand.schemas.chassis import ChassisCommand
from rackhand.worlds.chassis_model import WheelDrive

# Older commands stop the wheels (design: a driver that stops hearing commands stops the machine).
COMMAND_LIFE_NS = 100_000_000
STANDSTILL = Twist2(linear=0.0, angular=0.0)


def is_fresh(command: ChassisCommand | None, stamp: int) -> bool:
    """Whether the command may drive the control step that begins at ``stamp``, all of which comes after that stamp."""
    return command is not None and stamp - command.answers < COMMAND_LIFE_NS


@dataclass(frozen=True)
class WheelTargets:
    """Rim speeds in m/s."""

    left: float
    right: float


def targets_of(twist: Twist2, drive: WheelDrive) -> WheelTargets:
    half = drive.wheel_separation / 2
    return WheelTargets(twist.linear - half * twist.angular, twist.linear + half * twist.angular)


def twist_of(targets: WheelTargets, drive: WheelDrive) -> Twist2:
    return Twist2(
        linear=(targets.left + targets.right) / 2, angular=(targets.right - targets.left) / drive.wheel_separation
    )


def follow(now: WheelTargets, wanted: Twist2, drive: WheelDrive, dt: float) -> WheelTargets:
    """Wheel targets ``dt`` later, on the way to ``wanted``, within the drive's limits of speed and acceleration."""
    present = twist_of(now, drive)
    linear = approach(
        present.linear, clamp(wanted.linear, drive.max_linear), drive.acceleration * dt, drive.deceleration * dt
    )
    turn = drive.angular_acceleration * dt
    angular = approach(present.angular, clamp(wanted.angular, drive.max_angular), turn, turn)
    return targets_of(Twist2(linear=linear, angular=angular), drive)


def brake(now: WheelTargets, drive: WheelDrive, loaded: bool, dt: float) -> WheelTargets:
    """Wheel targets ``dt`` later while each wheel is braked to a stop."""
    step = (drive.braking_loaded if loaded else drive.braking) * dt
    return WheelTargets(approach(now.left, 0.0, step, step), approach(now.right, 0.0, step, step))


def approach(now: float, wanted: float, up: float, down: float) -> float:
    """``now`` moved towards ``wanted``, at most ``up`` away from zero or ``down`` towards it; zero is not skipped."""
    if now * wanted < 0:
        wanted = 0.0
    limit = up if abs(wanted) > abs(now) else down
    return now + clamp(wanted - now, limit)


def clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
