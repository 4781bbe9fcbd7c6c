"""How far a rack slides on the jack over a course of 40 m at the limits for its weight: physics, no planner."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.report import Report
from rackhand.schemas.base import Twist2
from rackhand.schemas.chassis import ChassisCommand
from rackhand.services.planner.control.load_limits import load_limits
from rackhand.services.planner.control.speed_profile import limited
from rackhand.services.planner.settings import Limits, NavigationSettings
from rackhand.services.sim.chassis.noise import NoiseSettings
from rackhand.services.sim.simulation import Simulation
from rackhand.worlds.chassis_model import ChassisProfile, load_profile
from rackhand.worlds.world_model import CONTROL_STEP_NS, World, load_world

LOADS = (("standard", 0), ("large", 0), ("standard", 210), ("large", 120))  # kind, kilograms of goods on the top
FRICTIONS = (0.5, 0.3)  # of the plate: the profile's, and that of one that is worn or dusty
LEGS, LEG = 10, 4.0  # straights and their length in metres, with a turn of 90° between
STROKE = 12.6  # seconds
COMMAND = 0.04  # seconds between two commands


@dataclass(frozen=True)
class Slide:
    """``slide`` in metres and ``turn`` in radians at the end; ``lean`` in radians, the greatest on the way."""

    way: float
    slide: float
    turn: float
    lean: float


def run() -> Report:
    profile = load_profile("longjack")
    own = NavigationSettings().for_chassis(profile.describe()).control
    rows = []
    for kind, goods in LOADS:
        for friction in FRICTIONS:
            mass = load_world("warehouse").rack_kinds[kind].mass + goods
            limits = load_limits(own, mass / profile.jack.max_load) if profile.jack is not None else own
            with_limits = course(kind, goods, profile, friction, limits)
            without = course(kind, goods, profile, friction, own)
            rows.append(
                (
                    f"{kind}, {mass:g} kg",
                    f"{friction:g}",
                    f"{-limits.max_forward_decel:.2f}",
                    f"{with_limits.way:.1f}",
                    f"{with_limits.slide * 1e3:.2f}",
                    f"{with_limits.turn * 1e3:.2f}",
                    f"{with_limits.lean * 1e3:.2f}",
                    f"{without.slide * 1e3:.2f}",
                )
            )
            print(" | ".join(rows[-1]), flush=True)
    return Report(
        title="Carrying: how far a rack slides",
        command="python -m benchmarks carrying",
        header=("rack", "friction", "braking m/s²", "way m", "slide mm", "turn mrad", "lean mrad", "without limits mm"),
        rows=rows,
        remarks="A forced course at full speed: ten straights, with turns on the spot and in motion by turns; goods on "
        "the top board. 0.5 is the friction of the plate, 0.3 that of a worn one. The last column is the same course "
        "with the limits of a chassis without a load. Physics only, exact and without noise: one run each.",
    )


def course(kind: str, goods: float, profile: ChassisProfile, friction: float, limits: Limits) -> Slide:
    """Drive the course with a rack of that kind and goods on the jack."""
    simulation = Simulation(hall(kind, goods), {"amr1": with_friction(profile, friction)}, 0, NoiseSettings(scale=0.0))
    still = Twist2(linear=0.0, angular=0.0)
    for _ in range(round(STROKE / COMMAND)):
        drive(simulation, still, "up")
    before, way, lean = on_plate(simulation), 0.0, 0.0
    for twist in twists(limits):
        drive(simulation, twist, "hold")
        way += abs(twist.linear) * COMMAND
        lean = max(lean, on_plate(simulation)[3])
    after = on_plate(simulation)
    return Slide(way, math.hypot(after[0] - before[0], after[1] - before[1]), abs(after[2] - before[2]), lean)


def twists(limits: Limits) -> Iterator[Twist2]:
    """The commands of the course, one each ``COMMAND``: each second turn is driven at half speed, without a stop."""
    now = Twist2(linear=0.0, angular=0.0)
    for leg in range(LEGS):
        in_turn = 0.5 * limits.max_forward_velocity if leg % 2 else 0.0
        way, turned, side = 0.0, 0.0, 1 if leg % 4 < 2 else -1
        while way < LEG - (now.linear**2 - in_turn**2) / (-2 * limits.max_forward_decel):
            now = limited(now, limits.max_forward_velocity, 0.0, COMMAND, limits)
            way += now.linear * COMMAND
            yield now
        while turned < math.pi / 2 - now.angular**2 / (2 * limits.max_angular_acc):
            now = limited(now, in_turn, side * limits.max_angular_velocity, COMMAND, limits)
            turned += abs(now.angular) * COMMAND
            yield now
        while abs(now.angular) > 1e-6:
            now = limited(now, in_turn, 0.0, COMMAND, limits)
            yield now
    for _ in range(50):
        now = limited(now, 0.0, 0.0, COMMAND, limits)
        yield now


def hall(kind: str, goods: float) -> World:
    """A floor with a chassis under a rack, the goods in one box on its top."""
    box = {"size": (0.6, 0.6, 0.4), "pose": (0, 0, 0), "lies_on": "rack", "mass": goods}
    return World.model_validate(
        {
            "version": 1,
            "name": "carrying",
            "bounds": (-50, -50, 50, 50),
            "robots": {"amr1": {"profile": "longjack", "pose": (0, 0, 0)}},
            "rack_kinds": {name: rack.model_dump() for name, rack in load_world("warehouse").rack_kinds.items()},
            "racks": {"rack": {"kind": kind, "pose": (0, 0, 0)}},
            "items": {"goods": box} if goods else {},
        }
    )


def with_friction(profile: ChassisProfile, friction: float) -> ChassisProfile:
    assert profile.jack is not None
    return profile.model_copy(update={"jack": profile.jack.model_copy(update={"friction": friction})})


def drive(simulation: Simulation, twist: Twist2, jack: Any) -> None:
    for _ in range(round(COMMAND * 1e9 / CONTROL_STEP_NS)):
        simulation.command("amr1", ChassisCommand(answers=simulation.stamp, twist=twist, jack=jack))
        simulation.step()


def on_plate(simulation: Simulation) -> tuple[float, float, float, float]:
    """The rack in the frame of the chassis: x, y, yaw, and how far it leans."""
    chassis, rack = simulation.data.body("amr1"), simulation.data.body("rack")
    turned = np.array(chassis.xmat).reshape(3, 3).T
    x, y, _ = turned @ (rack.xpos - chassis.xpos)
    seen = turned @ np.array(rack.xmat).reshape(3, 3)
    return float(x), float(y), math.atan2(seen[1, 0], seen[0, 0]), math.acos(min(1.0, float(seen[2, 2])))
