"""What the simulator's tests share: small worlds, and driving them by hand."""

from __future__ import annotations

from typing import Any

from rackhand.schemas.base import Twist2
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.topics import Topic
from rackhand.services.sim.chassis.noise import NoiseSettings
from rackhand.services.sim.simulation import CONTROL_STEP_NS, Simulation
from rackhand.worlds.chassis_model import load_profiles
from rackhand.worlds.world_model import World

EXACT = NoiseSettings(scale=0.0)
STILL = Twist2(linear=0.0, angular=0.0)


def make_world(**parts: Any) -> World:
    """An empty floor with one longjack at the origin, and what is given."""
    content: dict[str, Any] = {
        "version": 1,
        "name": "test",
        "bounds": (-10, -10, 10, 10),
        "robots": {"amr1": {"profile": "longjack", "pose": (0, 0, 0), "battery": 0.5}},
    }
    return World.model_validate(content | parts)


def make_simulation(world: World | None = None, seed: int = 0, noise: NoiseSettings = EXACT) -> Simulation:
    world = world or make_world()
    return Simulation(world, load_profiles(world), seed, noise)


def drive(
    simulation: Simulation,
    seconds: float,
    linear: float = 0.0,
    angular: float = 0.0,
    robot: str = "amr1",
    jack: Any = "hold",
) -> list[tuple[Topic[Any], Any]]:
    """Answer every instant of the chassis with this twist for so long. Returns all that was published meanwhile."""
    heard, end = [], simulation.stamp + round(seconds * 1e9)
    while simulation.stamp < end:
        if simulation.stamp % CONTROL_STEP_NS == 0:
            twist = Twist2(linear=linear, angular=angular)
            simulation.command(robot, ChassisCommand(answers=simulation.stamp, twist=twist, jack=jack))
        simulation.step()
        heard += [(o.topic, o.message) for o in simulation.outputs]
    return heard


def coast(simulation: Simulation, seconds: float) -> list[tuple[Topic[Any], Any]]:
    """Let time pass without commands."""
    heard, end = [], simulation.stamp + round(seconds * 1e9)
    while simulation.stamp < end:
        simulation.step()
        heard += [(o.topic, o.message) for o in simulation.outputs]
    return heard


def newest(simulation: Simulation, topic: Topic[Any]) -> Any:
    """The message of that topic due now; None if none is."""
    return next((o.message for o in simulation.outputs if o.topic is topic), None)
