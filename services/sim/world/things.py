"""All that can be changed in a running world."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rackhand.services.sim.actors.movables import Movables
from rackhand.services.sim.actors.obstacles import Obstacles
from rackhand.services.sim.arm.arm import Arm
from rackhand.services.sim.chassis.robot import Robot
from rackhand.services.sim.lift.cabin import Lift


@dataclass(frozen=True)
class Things:
    """Of one model and data."""

    robots: Mapping[str, Robot]
    arms: Mapping[str, Arm]
    lifts: Mapping[str, Lift]
    obstacles: Obstacles
    movables: Movables
