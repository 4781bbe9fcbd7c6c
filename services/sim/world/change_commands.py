"""``rackhand world place``, ``move``, ``push``, ``fault`` …: change the world that runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Annotated, Any

import typer
from pydantic import TypeAdapter, ValidationError

from rackhand.bus import Bus, BusConfig, CallTimeout, Refused, Unavailable
from rackhand.schemas import topics
from rackhand.schemas.codec import explain
from rackhand.schemas.faults import FAULTS
from rackhand.schemas.service import CELL, ServiceId
from rackhand.schemas.world import WorldReply, WorldRequest

MOMENT, PATIENCE = 1.0, 10.0  # seconds in which a simulator usually answers, and in which it must have
_REQUEST: TypeAdapter[WorldRequest] = TypeAdapter(WorldRequest)

At = Annotated[tuple[float, float, float], typer.Option(help="x, y (m) and yaw (rad) in the map")]


class CannotChange(Exception):
    """The world was not changed; the text is for the user."""


def ask_world(fields: Mapping[str, Any]) -> WorldReply:
    """One request to the simulator on the bus of the environment. Raises ``CannotChange``."""
    try:
        request = _REQUEST.validate_python({"request": dict(fields)})
    except ValidationError as error:
        raise CannotChange(explain(error)) from None
    with Bus(ServiceId("world-command", CELL), BusConfig()) as bus:
        try:
            return _patient(partial(_ask_simulator, bus, request))
        except Refused as refused:
            raise CannotChange(refused.text) from None
        except (Unavailable, CallTimeout) as error:
            text = f"no simulator answered at {BusConfig().connect} within {PATIENCE:g} s: {error}. Is the cell up?"
            raise CannotChange(text) from None


def _ask_simulator(bus: Bus, request: WorldRequest, patience: float) -> WorldReply:
    return bus.call_when_served(topics.WORLD_CONTROL, request, timeout=10.0, patience=patience)


def _patient(ask: Callable[[float], WorldReply]) -> WorldReply:
    """Asks for so many seconds; what takes longer than a moment is said. Raises as ``ask`` does."""
    try:
        return ask(MOMENT)
    except Unavailable:
        typer.echo(f"world: waiting for a simulator, up to {PATIENCE:g} s", err=True)
    return ask(PATIENCE - MOMENT)


def place(
    name: str,
    at: At,
    kind: Annotated[str, typer.Option(help="box, cylinder or person")] = "box",
    size: Annotated[str, typer.Option(help="metres: box l,w,h; cylinder and person radius,height")] = "0.4,0.4,0.4",
) -> None:
    """Put an obstacle into the world, or move the one of that name.

    Example: `rackhand world place crate --at 9.6 11.0 0.5 --size 0.6,0.4,0.8`
    """
    try:
        sizes = [float(part) for part in size.split(",")]
    except ValueError:
        raise typer.BadParameter(f"{size!r}: want numbers separated by commas") from None
    _change(op="place", name=name, kind=kind, size=sizes, pose=_pose(at))


def move(
    name: Annotated[str, typer.Argument(help="a rack or an item; what lies on a rack moves with it")],
    at: At,
    on: Annotated[str | None, typer.Option(help="box or rack that the item is put on; default: the floor")] = None,
    level: Annotated[int | None, typer.Option(help="board of that rack, from 0; default: its top")] = None,
) -> None:
    """Set a rack or an item down elsewhere.

    Example: `rackhand world move rack_s1 --at 5.8 12.2 1.5708`, or
    `rackhand world move parcel_red --at 16.6 12.2 0 --on rack_p3 --level 1`
    """
    _change(op="move_object", name=name, pose=_pose(at), lies_on=on, level=level)


def move_robot(robot: str, at: At) -> None:
    """Set a chassis down elsewhere, at rest.

    Example: `rackhand world move-robot amr1 --at 5.5 7.5 0`
    """
    _change(op="move_robot", robot=robot, pose=_pose(at))


def remove(name: Annotated[str, typer.Argument(help="an obstacle, a rack or an item")]) -> None:
    """Take something out of the world. Racks and items can be restored.

    Example: `rackhand world remove rack_s1`
    """
    _change(op="remove", name=name)


def restore(name: Annotated[str, typer.Argument(help="a removed rack or item")]) -> None:
    """Bring a removed rack or item back to where it was.

    Example: `rackhand world restore rack_s1`
    """
    _change(op="restore", name=name)


def push(
    name: Annotated[str, typer.Argument(help="a rack or an item")],
    shift: Annotated[
        tuple[float, float, float] | None, typer.Option(help="x, y (m) and yaw (rad) in its own frame, at once")
    ] = None,
    impulse: Annotated[tuple[float, float] | None, typer.Option(help="x, y in the map (N·s)")] = None,
    height: Annotated[
        float | None, typer.Option(help="of the impulse above the floor (m); default: centre of mass")
    ] = None,
) -> None:
    """Push a rack or an item: shift it (a carried rack then slides on the jack), or hit it.

    Example: `rackhand world push rack_s1 --shift 0.05 0 0`, or `rackhand world push rack_s1 --impulse 0 60`
    """
    _change(op="push", name=name, shift=None if shift is None else _pose(shift), impulse=impulse, height=height)


def fault(
    name: Annotated[str, typer.Argument(metavar="FAULT", help=f"one of: {', '.join(FAULTS)}")],
    target: Annotated[str, typer.Argument(help="name of the chassis, rack, charger, lift or other thing that has it")],
    part: Annotated[int | None, typer.Option(help="one of its parts; default: all")] = None,
    amount: Annotated[float | None, typer.Option(help="how much of it, where there is more and less")] = None,
    at: Annotated[
        tuple[float, float, float] | None, typer.Option(help="x, y (m) and yaw (rad) in the map, where it needs one")
    ] = None,
    shift: Annotated[
        tuple[float, float, float] | None, typer.Option(help="x, y (m) and yaw (rad) in the frame of the target")
    ] = None,
    clear: Annotated[bool, typer.Option("--clear", help="end the fault")] = False,
) -> None:
    """Cause a fault, or end it. `rackhand world faults` lists them with what they do.

    Example: `rackhand world fault lidar_dead amr1`, `rackhand world fault lidar_dead amr1 --clear`,
    `rackhand world fault leg_hidden rack_s1 --part 2`, `rackhand world fault battery_critical amr1 --amount 0.03`,
    `rackhand world fault kidnapped amr1 --at 5.5 7.5 0`, or `rackhand world fault dock_moved charger_1 --shift 0 0.3 0`
    """
    given = next((pose for pose in (at, shift) if pose is not None), None)
    if (kind := FAULTS.get(name)) is not None and given is not None and (shift is None) == (kind.pose == "shift"):
        raise typer.BadParameter(f"fault {name} takes {f'--{kind.pose}' if kind.pose else 'neither --at nor --shift'}")
    pose = None if given is None else _pose(given)
    _change(op="fault", fault=name, target=target, part=part, amount=amount, pose=pose, active=not clear)


def faults() -> None:
    """List the faults that can be caused.

    Example: `rackhand world faults`
    """
    for kind in FAULTS.values():
        options = f" [{', '.join(kind.options)}]" if kind.options else ""
        typer.echo(f"{kind.name:<22} {kind.target:<9} {kind.text}{options}")


def inspect() -> None:
    """Print the state of the world as JSON: time, seed, digest, contacts.

    Example: `rackhand world inspect`
    """
    typer.echo(_ask({"op": "inspect"}).model_dump_json(indent=2))


def _pose(at: tuple[float, float, float]) -> dict[str, float]:
    return dict(zip(("x", "y", "yaw"), at, strict=True))


def _change(**fields: Any) -> None:
    reply = _ask(fields)
    typer.echo(f"done at {reply.clock.stamp / 1e9:.2f} s")


def _ask(fields: Mapping[str, Any]) -> WorldReply:
    try:
        return ask_world(fields)
    except CannotChange as error:
        typer.echo(f"world: {error}", err=True)
        raise typer.Exit(2) from None


def add_change_commands(app: typer.Typer) -> None:
    for command in (place, move, remove, restore, push, fault, faults, inspect):
        app.command()(command)
    app.command("move-robot")(move_robot)
