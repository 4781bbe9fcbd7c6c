"""``rackhand world …``: list worlds, draw the map of one, make one from benchmark data, change the one that runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from rackhand.services.sim.world.change_commands import add_change_commands
from rackhand.worlds.data import WorldFileError
from rackhand.worlds.world_model import known_worlds, load_world, world_directory


def list_worlds() -> None:
    """List the worlds that come with rackhand."""
    for name in known_worlds():
        typer.echo(f"{name:<12} {load_world(name).description}")


def draw_map(
    world: Annotated[str, typer.Argument(help="name of a world, or path of its folder")],
    out: Annotated[
        Path | None, typer.Option(help="folder for map.png and map.yaml  [default: the world's own]")
    ] = None,
) -> None:
    """Draw the map of a world: its static objects, cut at the height of the lidar.

    Example: `rackhand world map warehouse --out /tmp/maps`
    """
    from rackhand.services.sim.world.maps import write_map  # takes time, which other commands need not wait for

    try:
        paths = write_map(load_world(world), out or world_directory(world))
    except (WorldFileError, OSError) as error:
        _fail(error)
    typer.echo("\n".join(str(path) for path in paths))


def from_barn(
    file: Annotated[Path, typer.Argument(help="worlds.json of the BARN data set: cylinders of each world")],
    number: Annotated[str, typer.Argument(help="which of its worlds")],
    folder: Annotated[Path, typer.Argument(help="folder to write the world to")],
) -> None:
    """Make a world of the BARN navigation benchmark, with a Jackal at its start and an empty map.

    Example: `rackhand world from-barn worlds.json 42 ./barn_42`, then `rackhand up --world ./barn_42`
    """
    from rackhand.services.sim.world.barn import write_barn_world  # see `draw_map`

    try:
        paths = write_barn_world(file, number, folder)
    except (WorldFileError, OSError) as error:
        _fail(error)
    typer.echo("\n".join(str(path) for path in paths))


def _fail(error: Exception) -> None:
    typer.echo(f"world: {error}", err=True)
    raise typer.Exit(2)


def add_commands(app: typer.Typer) -> None:
    app.command("list")(list_worlds)
    app.command("map")(draw_map)
    app.command("from-barn")(from_barn)


if __name__ == "__main__":
    tool = typer.Typer(help=__doc__, no_args_is_help=True, rich_markup_mode="markdown")
    add_commands(tool)
    add_change_commands(tool)
    tool(prog_name="rackhand world")
