"""The ``rackhand`` command."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from rackhand.services.launch.cell import CELL_FILE, CannotStart, run_cell
from rackhand.services.launch.health import Health, ask_health
from rackhand.services.launch.motion import CannotAsk, send_command
from rackhand.services.launch.prepare import CannotPrepare
from rackhand.services.launch.prepare import prepare as prepare_services
from rackhand.services.launch.processes import Address, CellOptions
from rackhand.services.launch.viewing import CannotView, open_viewer, record_cell

DEFAULTS = CellOptions()
DEFAULT_VIEWER = Address("127.0.0.1", 9090)


def _examples(*lines: str) -> str:
    """An epilog that keeps its lines (``\\b`` is click's mark for that)."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


app = typer.Typer(
    name="rackhand",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    help="A goods-to-arm cell: mobile robots, arms, physics and a gateway, as processes that communicate over Zenoh.",
    epilog=_examples("rackhand up", "rackhand up --world empty --speed max", "rackhand status", "rackhand topics"),
)


def main() -> None:
    """Entry point of the console script."""
    app()


def _speed(text: str) -> float | None:
    """``max`` or a factor; raises ``typer.BadParameter``."""
    if text == "max":
        return None
    try:
        factor = float(text)
    except ValueError:
        factor = 0.0
    if not 0 < factor <= 1000:
        raise typer.BadParameter(f"{text!r}: want max, or a factor over 0 and up to 1000 (1 is real time)")
    return factor


@app.command(
    epilog=_examples(
        "rackhand up --world empty --speed max",
        "rackhand up --lockstep --seed 7",
        "rackhand up --world pick_station --crf-port 5000",
        "rackhand up --world pick_station --arm fr3",
        "rackhand up --world empty --no-sim --robot amr1    # then start its driver, as examples/09_hardware_driver.py",
        "rackhand up --robot-profile jackal --port 8091 --bus-port 7448 --viewer-port 9091 --state-dir var/second",
    )
)
def up(
    world: Annotated[str, typer.Option(help="name of a world, or a folder made by `rackhand world`")] = DEFAULTS.world,
    speed: Annotated[str, typer.Option(help="ratio to real time (0.1 … 1000), or max")] = "1",
    lockstep: Annotated[
        bool,
        typer.Option(
            "--lockstep", help="let the simulator wait for planner and controller: the same seed gives the same run"
        ),
    ] = DEFAULTS.lockstep,
    seed: Annotated[int | None, typer.Option(min=0, help="seed of all noise; default: that of the world")] = (
        DEFAULTS.seed
    ),
    host: Annotated[str, typer.Option(help="address the gateway listens on")] = DEFAULTS.http.host,
    port: Annotated[int, typer.Option(min=0, max=65535, help="port of the gateway; 0 picks a free one")] = (
        DEFAULTS.http.port
    ),
    bus_port: Annotated[int, typer.Option(min=0, max=65535, help="port of the bus router; 0 picks a free one")] = (
        DEFAULTS.bus.port
    ),
    crf_port: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="also offer CRF's packet framing on TCP: the first arm here, the next ones on the next ports; "
            "0 picks a free one. Off by default",
        ),
    ] = DEFAULTS.crf_port,
    viewer: Annotated[bool, typer.Option("--viewer/--no-viewer", help="serve the live view in Rerun")] = True,
    viewer_port: Annotated[
        int, typer.Option(min=0, max=65535, help="port of the live view; 0 picks a free one")
    ] = DEFAULT_VIEWER.port,
    robot_profile: Annotated[
        str | None, typer.Option(help="chassis profile of amr1, such as longjack or jackal; default: that of the world")
    ] = DEFAULTS.profile,
    arm: Annotated[
        str | None, typer.Option(help="kind of every arm, such as ur5e or fr3; default: that of the world")
    ] = DEFAULTS.arm,
    state_dir: Annotated[
        Path, typer.Option(help="folder for data that is kept between runs: moves, maps")
    ] = DEFAULTS.state_dir,
    sim: Annotated[
        bool,
        typer.Option(
            "--sim/--no-sim",
            help="simulate the robots; with --no-sim, each robot needs a hardware driver on the bus, and "
            "the simulator's options have no effect",
        ),
    ] = DEFAULTS.sim,
    robot: Annotated[
        list[str] | None, typer.Option(help="serve only this chassis or arm of the world; may be given several times")
    ] = None,
) -> None:
    """Start the cell, and keep it running until Ctrl-C or SIGTERM."""
    options = CellOptions(
        world=world,
        speed=_speed(speed),
        lockstep=lockstep,
        seed=seed,
        http=Address(host, port),
        bus=Address(DEFAULTS.bus.host, bus_port),
        crf_port=crf_port,
        profile=robot_profile,
        arm=arm,
        viewer=Address(DEFAULT_VIEWER.host, viewer_port) if viewer else None,
        state_dir=state_dir,
        robots=tuple(robot or ()),
        sim=sim,
    )
    try:
        code = run_cell(options)
    except CannotStart as error:
        _fail(str(error))
    raise typer.Exit(code)


@app.command(epilog=_examples("rackhand prepare"))
def prepare() -> None:
    """Compile the code that services compile at their first start; `make run` and `make test` do it once.

    It takes a minute or two, and some seconds when it has been done before.
    """
    try:
        seconds = prepare_services()
    except CannotPrepare as error:
        _fail(str(error))
    typer.echo(f"rackhand: compiled code is ready after {seconds:.0f} s")


@app.command(epilog=_examples("rackhand demo", "rackhand demo --lockstep --seed 7 --no-viewer"))
def demo(
    world: Annotated[str, typer.Option(help="name or folder of a world with the rack and the arm of the story")] = (
        DEFAULTS.world
    ),
    speed: Annotated[str | None, typer.Option(help="ratio to real time, or max; default: 1, in lockstep max")] = None,
    lockstep: Annotated[bool, typer.Option("--lockstep", help="as of `rackhand up`")] = DEFAULTS.lockstep,
    seed: Annotated[int | None, typer.Option(min=0, help="as of `rackhand up`")] = DEFAULTS.seed,
    viewer: Annotated[bool, typer.Option("--viewer/--no-viewer", help="serve the live view in Rerun")] = True,
) -> None:
    """Start a cell and play goods to arm in it: a rack is fetched, presented, picked from and taken back."""
    from rackhand.services.launch.demo.play import play

    given = speed or ("max" if lockstep else "1")
    _speed(given)
    options = [
        "--speed",
        given,
        *(["--lockstep"] if lockstep else []),
        *(["--seed", str(seed)] if seed is not None else []),
    ]
    raise typer.Exit(play(world, [*options, *(["--viewer-port", "0"] if viewer else ["--no-viewer"])]))


@app.command(epilog=_examples("rackhand status", "rackhand status --url http://127.0.0.1:8091"))
def status(
    url: Annotated[
        str | None, typer.Option(help="URL of the gateway; default: that of the cell in the state folder, or port 8090")
    ] = None,
    state_dir: Annotated[Path, typer.Option(help="state folder of the cell")] = DEFAULTS.state_dir,
) -> None:
    """Show which services are up. Exit status 0 if all are, 1 if not."""
    url = url or _known(state_dir, "http") or DEFAULTS.http.url
    health = ask_health(url.rstrip("/"), timeout=3.0)
    if health is None:
        _fail(f"no gateway answers at {url}. Is the cell up? Start it with `rackhand up`.")
    typer.echo(_health_table(health))
    raise typer.Exit(0 if health.all_up else 1)


@app.command(
    epilog=_examples(
        """rackhand motion arm1 '{"command":"getStatus"}'""",
        """rackhand motion arm1 '{"command":"lockControl","priority":10}'""",
        """rackhand motion arm1 '{"command":"appendPath","priority":10,"type":"joints",""",
        """                      "data":[[0,-1.57,1.57,-1.57,-1.57,0]]}'""",
        """rackhand motion arm1 '{"command":"setVelocity","priority":10,"type":"task","reference":1,""",
        """                      "data":[0.05,0,0,0,0,0]}'""",
        """rackhand motion arm1 '{"command":"softStop"}'""",
        """rackhand motion arm1 '{"command":"resumeControl","priority":10}'""",
    )
)
def motion(
    arm: Annotated[str, typer.Argument(help="name of the arm, as in arm1")],
    command: Annotated[str, typer.Argument(metavar="COMMAND-JSON", help="a CRF request")],
    url: Annotated[
        str | None, typer.Option(help="URL of the gateway; default: that of the cell in the state folder, or port 8090")
    ] = None,
    state_dir: Annotated[Path, typer.Option(help="state folder of the cell")] = DEFAULTS.state_dir,
) -> None:
    """Send one command to an arm and print its answer. Exit status 1 if there is no answer."""
    url = url or _known(state_dir, "http") or DEFAULTS.http.url
    try:
        typer.echo(send_command(url.rstrip("/"), arm, command))
    except CannotAsk as error:
        _fail(str(error))


@app.command(epilog=_examples("rackhand record run.rrd", "rackhand record run.rrd --bus tcp/127.0.0.1:7448"))
def record(
    file: Annotated[Path, typer.Argument(help="file to write; each further run of the world gets a number")],
    bus: Annotated[
        str | None, typer.Option(help="endpoint of the bus; default: that of the cell in the state folder")
    ] = None,
    state_dir: Annotated[Path, typer.Option(help="state folder of the cell")] = DEFAULTS.state_dir,
) -> None:
    """Record the running cell into a file for Rerun, until Ctrl-C or SIGTERM."""
    try:
        record_cell(file, bus or _known(state_dir, "bus"))
    except CannotView as error:
        _fail(str(error))


@app.command(epilog=_examples("rackhand view", "rackhand view run.rrd"))
def view(
    file: Annotated[Path | None, typer.Argument(help="a recording; default: the running cell")] = None,
    state_dir: Annotated[Path, typer.Option(help="state folder of the cell")] = DEFAULTS.state_dir,
) -> None:
    """Open Rerun's native viewer: on a recording or on the running cell."""
    try:
        open_viewer(file, _known(state_dir, "viewer_stream"))
    except CannotView as error:
        _fail(str(error))


@app.command(
    epilog=_examples(
        "rackhand topics", "rackhand topics --markdown > topics.md", "rackhand topics --asyncapi > asyncapi.json",
        "rackhand topics --access > access.json5",
    )
)  # fmt: skip
def topics(
    markdown: Annotated[bool, typer.Option("--markdown", help="as Markdown tables")] = False,
    asyncapi: Annotated[bool, typer.Option("--asyncapi", help="as an AsyncAPI 3 document (JSON)")] = False,
    access: Annotated[bool, typer.Option("--access", help="as Zenoh access control of each role (JSON5)")] = False,
) -> None:
    """Print the contract: every topic and query on the bus."""
    # All models take most of a second to import, which other commands need not wait for.
    from rackhand.services.launch import access_control, reference
    from rackhand.services.launch import asyncapi as contract

    if asyncapi or access:
        typer.echo(contract.text() if asyncapi else access_control.text(), nl=False)
        return
    show = reference.markdown if markdown else reference.plain
    typer.echo(f"{show(reference.topic_table())}\n\n{show(reference.query_table())}")


@app.command(
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []},
    epilog=_examples(
        "rackhand world list", "rackhand world map warehouse", "rackhand world move rack_s1 --at 5.8 12.2 1.5708",
        "rackhand world fault leg_hidden rack_s1 --part 2", "rackhand world push rack_s1 --shift 0.05 0 0",
    ),
)  # fmt: skip
def world(context: typer.Context) -> None:
    """List worlds, draw the map of a world, create a world from data; change the world that runs.

    `rackhand world --help` shows the commands.
    """
    bus = _known(DEFAULTS.state_dir, "bus")
    found = {"RACKHAND_BUS_CONNECT": bus} if bus is not None else {}
    _run_module("rackhand.services.sim.world.commands", context.args, found | os.environ)


@app.command(
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []},
    epilog=_examples("rackhand scenario list", "rackhand scenario run rack_missing", "rackhand scenario run warehouse"),
)
def scenario(context: typer.Context) -> None:
    """List, check and run scenarios: what goes wrong, when, and what must follow.

    `rackhand scenario --help` shows the commands.
    """
    _run_module("rackhand.scenarios", context.args, os.environ)


@app.command(
    context_settings={"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []},
    epilog=_examples(
        "rackhand sweep rack_missing lidar_dead --seeds 100",
        "rackhand sweep rack_slides_on_the_jack --set planner.control.max_forward_velocity=0.6,1.2",
    ),
)
def sweep(context: typer.Context) -> None:
    """Run scenarios with many seeds and settings, on all cores or on a Dask cluster.

    `rackhand sweep --help` shows the options.
    """
    _run_module("rackhand.scenarios", ["sweep", *context.args], os.environ)


def _run_module(module: str, arguments: Sequence[str], environment: Mapping[str, str]) -> NoReturn:
    """Commands of a package that `rackhand` does not import."""
    command = [sys.executable, "-m", module, *arguments]
    raise typer.Exit(subprocess.run(command, check=False, env=environment).returncode)


def _known(state_dir: Path, fact: str) -> str | None:
    """``cell.json`` of the cell that runs on this state folder, if one does."""
    try:
        return str(json.loads((state_dir / CELL_FILE).read_text())[fact])
    except (OSError, ValueError, KeyError):
        return None


def _health_table(health: Health) -> str:
    from rackhand.services.launch.reference import plain  # see `topics`

    rows: list[tuple[str, ...]] = [
        (
            f"{row.get('robot')}/{row.get('service')}",
            str(row.get("status")),
            _clock(row.get("since")),
            str(row.get("restarts", 0)),
        )
        for row in health.rows
    ]
    return plain((("service", "status", "since", "restarts"), rows))


def _clock(since: object) -> str:
    """Unix seconds as local time."""
    return f"{datetime.fromtimestamp(since):%H:%M:%S}" if isinstance(since, float) else "-"


def _fail(text: str) -> NoReturn:
    typer.echo(f"rackhand: {text}", err=True)
    raise typer.Exit(1)


if __name__ == "__main__":
    main()
