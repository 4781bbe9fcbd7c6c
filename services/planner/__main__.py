"""``python -m rackhand.services.planner``: the planner of one chassis."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import typer

from rackhand.bus import Bus
from rackhand.bus.log import configure_logging, get_logger
from rackhand.runtime.memory import freeze_gc
from rackhand.runtime.preparation import logged_progress
from rackhand.runtime.priority import PLANNER, set_niceness
from rackhand.schemas.service import ServiceId
from rackhand.services.planner.chassis import Chassis
from rackhand.services.planner.chassis_settings import ChassisSettings
from rackhand.services.planner.errors import StoreError
from rackhand.services.planner.map.directory import MapDirectoryError, floor_directories, read_map_directory
from rackhand.services.planner.modes import REMOTE_LIMITS, RemoteSettings
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.moves.records import HISTORY_LIMIT
from rackhand.services.planner.service import PlannerService
from rackhand.services.planner.settings import NavigationSettings, SpeedCaps
from rackhand.services.planner.store import PlannerStore
from rackhand.services.planner.warm_up import warm_up

log = get_logger(__name__)

_EXAMPLES = """
Plans and drives the moves of one chassis.

Examples:

  python -m rackhand.services.planner --robot amr1 --map worlds/warehouse

  python -m rackhand.services.planner --robot amr2 --store /var/lib/rackhand/amr2.sqlite --max-forward-velocity 0.8
"""


app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command(help=_EXAMPLES)
def main(
    robot: Annotated[str, typer.Option(help="name of the chassis on the bus")] = "amr1",
    map_directory: Annotated[
        Path | None,
        typer.Option(
            "--map",
            help="directory of map.yaml, its PNG and overlays.geojson; stored and selected at the first start with it",
        ),
    ] = None,
    store: Annotated[
        Path | None, typer.Option(help="SQLite file of moves, maps and parameters  [default: var/ROBOT/planner.sqlite]")
    ] = None,
    history: Annotated[int, typer.Option(min=1, help="how many moves are kept")] = HISTORY_LIMIT,
    max_forward_velocity: Annotated[
        float | None, typer.Option(min=0.05, help="m/s, at most the limit of the chassis  [default: that limit]")
    ] = None,
    max_angular_velocity: Annotated[
        float | None, typer.Option(min=0.05, help="rad/s, at most the limit of the chassis  [default: that limit]")
    ] = None,
    remote_max_forward_velocity: Annotated[float, typer.Option(min=0.0, max=2.0, help="m/s in remote mode")] = 0.8,
    refuse_moves_while_jacking: Annotated[
        bool,
        typer.Option(help="refuse moves while the jack moves, instead of holding them"),
    ] = False,
) -> None:
    configure_logging("planner")
    set_niceness(PLANNER)
    caps = SpeedCaps(max_forward_velocity or math.inf, max_angular_velocity or math.inf)
    settings = ChassisSettings(
        remote=RemoteSettings(REMOTE_LIMITS._replace(max_forward_velocity=remote_max_forward_velocity)),
        refuse_moves_while_jacking=refuse_moves_while_jacking,
    )
    navigation = NavigationSettings(caps=caps)
    path = store or Path("var") / robot / "planner.sqlite"
    try:
        with PlannerStore(path, robot, history) as kept, ThreadPoolExecutor(1, thread_name_prefix="plan") as planning:
            _prepare(kept, map_directory)
            with logged_progress(log):
                warm_up(navigation)
            motion = Motion(navigation, planning)
            chassis = Chassis(motion, kept.moves, kept.maps, kept.parameters, settings, kept.load, kept.explanations)
            with Bus(ServiceId("planner", robot)) as bus:
                bus.handle_signals()
                freeze_gc()
                PlannerService(bus, robot, chassis, kept).run()
    except (StoreError, MapDirectoryError) as error:
        typer.echo(f"planner of {robot}: {error}", err=True)
        raise typer.Exit(2) from None


def _prepare(store: PlannerStore, map_directory: Path | None) -> None:
    moves, maps = store.moves, store.maps
    for move in moves.closed:
        log.warning("a move was interrupted when the planner stopped", move=move.id, now=move.state)
    if map_directory is not None and maps.import_directory(read_map_directory(map_directory)):
        log.info("map stored and selected", directory=str(map_directory), id=maps.current and maps.current.id)
    for floor in floor_directories(map_directory) if map_directory is not None else ():
        if maps.import_directory(read_map_directory(floor), select=False):
            log.info("map of a further floor stored", directory=str(floor))
    if maps.current is None:
        log.warning("no map is in use; moves will fail until one is selected")


if __name__ == "__main__":
    app()
