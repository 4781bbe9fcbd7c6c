"""``python -m rackhand.services.planner``: the planner of one chassis."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from rackhand.bus import Bus
from rackhand.bus.log import configure_logging, get_logger
from rackhand.runtime.memory import freeze_gc
from rackhand.runtime.priority import PLANNER, set_niceness
from rackhand.schemas.service import ServiceId
from rackhand.services.planner.behaviors.navigator import ChassisNavigator
from rackhand.services.planner.chassis import Chassis, ChassisSettings
from rackhand.services.planner.errors import StoreError
from rackhand.services.planner.map.directory import MapDirectoryError, read_map_directory
from rackhand.services.planner.modes import RemoteLimits
from rackhand.services.planner.moves.records import HISTORY_LIMIT
from rackhand.services.planner.service import PlannerService
from rackhand.services.planner.settings import NavigationSettings, SpeedCaps
from rackhand.services.planner.store import PlannerStore

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
        Path | None, typer.Option(help="SQLite file of moves and maps  [default: var/ROBOT/planner.sqlite]")
    ] = None,
    history: Annotated[int, typer.Option(min=1, help="how many moves are kept")] = HISTORY_LIMIT,
    max_forward_velocity: Annotated[
        float | None, typer.Option(min=0.05, help="m/s, at most what the chassis can  [default: what it can]")
    ] = None,
    max_angular_velocity: Annotated[
        float | None, typer.Option(min=0.05, help="rad/s, at most what the chassis can  [default: what it can]")
    ] = None,
    remote_max_forward_velocity: Annotated[float, typer.Option(min=0.0, max=2.0, help="m/s in remote mode")] = 0.8,
) -> None:
    configure_logging("planner")
    set_niceness(PLANNER)
    caps = SpeedCaps(max_forward_velocity or math.inf, max_angular_velocity or math.inf)
    remote = RemoteLimits(
        max_forward_velocity=remote_max_forward_velocity,
        max_angular_velocity=min(RemoteLimits.max_angular_velocity, caps.max_angular_velocity),
    )
    path = store or Path("var") / robot / "planner.sqlite"
    try:
        with PlannerStore(path, robot, history) as kept:
            _prepare(kept, map_directory)
            navigator = ChassisNavigator(NavigationSettings(caps=caps))
            navigator.warm_up()
            chassis = Chassis(navigator, kept.moves, kept.maps, ChassisSettings(remote=remote))
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
        log.warning("a move was running when the planner ended last time", move=move.id, now=move.state)
    if map_directory is not None and maps.import_directory(read_map_directory(map_directory)):
        log.info("map stored and selected", directory=str(map_directory), id=maps.current and maps.current.id)
    if maps.current is None:
        log.warning("no map is in use; moves will fail until one is selected")


if __name__ == "__main__":
    app()
