"""``python -m rackhand.services.sim``: run a world, or work on worlds (``map``, ``from-barn``, ``list``)."""

from __future__ import annotations

import time
import uuid
from typing import Annotated

import typer

from rackhand.bus import Bus
from rackhand.bus.log import configure_logging, get_logger
from rackhand.runtime.memory import freeze_gc
from rackhand.runtime.preparation import logged_progress
from rackhand.runtime.priority import set_short_slice
from rackhand.schemas.service import WORLD, ServiceId
from rackhand.services.sim.chassis.noise import NoiseSettings
from rackhand.services.sim.pacing import Pacer
from rackhand.services.sim.service import SimService
from rackhand.services.sim.session import Run, Session
from rackhand.services.sim.simulation import Simulation
from rackhand.services.sim.world.commands import add_commands
from rackhand.worlds.arm_model import load_arm_descriptions, with_arm_kind
from rackhand.worlds.chassis_model import load_profiles
from rackhand.worlds.data import WorldFileError
from rackhand.worlds.scatter import scattered
from rackhand.worlds.world_model import load_world

log = get_logger(__name__)

_HELP = """
The simulator: MuJoCo physics of a world, on the bus.

Examples:

  python -m rackhand.services.sim --world warehouse

  python -m rackhand.services.sim --world warehouse --speed max --lockstep --seed 7 --wait-for amr1/planner

  python -m rackhand.services.sim --world ./my_world --speed 0.5 --paused

  python -m rackhand.services.sim --world empty --profile jackal --noise 0

  python -m rackhand.services.sim --world warehouse --seed 3 --rack-offset 0.05 --rack-turn 0.07

  python -m rackhand.services.sim map warehouse
"""

app = typer.Typer(help=_HELP, invoke_without_command=True, no_args_is_help=False, rich_markup_mode="markdown")
add_commands(app)


def _speed(text: str) -> float | None:
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = 0.0
    if not 0 < speed <= 1000:
        raise typer.BadParameter(f"{text!r}: want a ratio to real time above 0 and up to 1000, or max")
    return speed


def _service(text: str) -> ServiceId:
    robot, _, service = text.partition("/")
    if not robot or not service or "/" in service:
        raise typer.BadParameter(f"{text!r} is not a service; want ROBOT/SERVICE, as in amr1/planner")
    return ServiceId(service, robot)


@app.callback()
def main(
    context: typer.Context,
    world: Annotated[str, typer.Option(help="name of a world, or path of its folder")] = "warehouse",
    speed: Annotated[str, typer.Option(help="ratio to real time (0.1 … 1000), or max")] = "1",
    lockstep: Annotated[
        bool, typer.Option("--lockstep", help="wait at each control step for the commands due then")
    ] = False,
    seed: Annotated[int | None, typer.Option(min=0, help="seed of all noise  [default: that of the world]")] = None,
    wait_for: Annotated[
        list[str] | None, typer.Option(help="stay at time 0 until ROBOT/SERVICE has joined; may be given several times")
    ] = None,
    paused: Annotated[bool, typer.Option("--paused", help="begin paused")] = False,
    profile: Annotated[
        str | None,
        typer.Option(
            "--profile", "--robot-profile", help="chassis profile of every robot  [default: that of the world]"
        ),
    ] = None,
    arm: Annotated[str | None, typer.Option(help="kind of every arm  [default: that of the world]")] = None,
    noise: Annotated[float, typer.Option(min=0, help="factor of all sensor noise; 0 for exact sensors")] = 1.0,
    pose_noise: Annotated[float, typer.Option(min=0, help="1σ of the localised position in metres")] = 0.01,
    yaw_noise: Annotated[float, typer.Option(min=0, help="1σ of the localised heading in radians")] = 0.005,
    rack_offset: Annotated[float, typer.Option(min=0, help="racks begin up to so many metres off, by the seed")] = 0.0,
    rack_turn: Annotated[float, typer.Option(min=0, help="racks begin turned by up to so many radians")] = 0.0,
) -> None:
    if context.invoked_subcommand is not None:
        return
    configure_logging("sim")
    settings = NoiseSettings(pose_xy=pose_noise, pose_yaw=yaw_noise, scale=noise)
    awaited = tuple(_service(text) for text in wait_for or ())
    pace = _speed(speed)
    try:
        loaded = with_arm_kind(load_world(world), arm)
        load_arm_descriptions(loaded)
        profiles = load_profiles(loaded, profile)
        robots = {*profiles, *loaded.arms}
        if unknown := {service.robot for service in awaited} - robots:
            raise WorldFileError(f"--wait-for names {sorted(unknown)}; robots of {loaded.name}: {sorted(robots)}")
        with logged_progress(log):
            session = Session(
                build=lambda chosen: Simulation(
                    scattered(loaded, chosen, rack_offset, rack_turn), profiles, chosen, settings
                ),
                new_run=lambda: Run(uuid.uuid4().hex[:12], time.time_ns()),
                seed=loaded.seed if seed is None else seed,
                pacer=Pacer(loaded.control_step_ns, pace, lockstep, paused, awaited),
            )
    except WorldFileError as error:
        typer.echo(f"sim: {error}", err=True)
        raise typer.Exit(2) from None
    set_short_slice()
    with Bus(ServiceId("sim", WORLD)) as bus:
        bus.handle_signals()
        freeze_gc()
        SimService(bus, session).run()


if __name__ == "__main__":
    app(prog_name="python -m rackhand.services.sim")
