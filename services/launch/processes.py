"""The cell as data: one row a process. Adding a service is adding a row to ``cell_processes``."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import worlds

WORLD_FILE = "world.yaml"


@dataclass(frozen=True)
class Address:
    """A TCP address something listens on."""

    host: str
    port: int

    @property
    def endpoint(self) -> str:
        """As Zenoh writes it."""
        return f"tcp/{self.host}:{self.port}"

    @property
    def url(self) -> str:
        return f"http://{self.host}:{self.port}"

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


@dataclass(frozen=True)
class Process:
    """One operating-system process of the cell.

    It is started as soon as every process it ``needs`` runs and accepts connections where it ``listens``. ``env`` is
    laid over the supervisor's own environment; ``option`` is what a user changes when the address is taken.
    """

    name: str
    argv: tuple[str, ...]
    needs: tuple[str, ...] = ()
    listens: Address | None = None
    option: str = ""
    env: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class CellOptions:
    """What ``rackhand up`` can be told. ``speed`` None is as fast as possible; ``world`` is a name or a folder.

    ``seed`` and ``profile`` are the world's own where None.
    """

    world: str = "warehouse"
    speed: float | None = 1.0
    lockstep: bool = False
    seed: int | None = None
    http: Address = Address("127.0.0.1", 8090)
    bus: Address = Address("127.0.0.1", 7447)
    robot: str = "amr1"
    profile: str | None = None
    state_dir: Path = Path("var")


def cell_processes(options: CellOptions, environment: Mapping[str, str]) -> tuple[Process, ...]:
    """The process table. ``environment`` is the user's: bus endpoints named there become the router's neighbours."""
    bus = {"RACKHAND_BUS_CONNECT": options.bus.endpoint}
    return (
        Process(
            "router",
            _module("bus.router", *_router_arguments(options, environment.get("RACKHAND_BUS_CONNECT", ""))),
            listens=options.bus,
            option="--bus-port",
        ),
        Process("sim", _module("services.sim", *_sim_arguments(options)), needs=("router",), env=bus),
        Process("planner", _module("services.planner", *_planner_arguments(options)), needs=("router",), env=bus),
        Process(
            "gateway",
            _module("services.gateway", *_gateway_arguments(options)),
            needs=("router",),
            listens=options.http,
            option="--port",
            env=bus,
        ),
    )


def _module(module: str, *arguments: str) -> tuple[str, ...]:
    return (sys.executable, "-m", module, *arguments)


def _router_arguments(options: CellOptions, neighbours: str) -> tuple[str, ...]:
    connect = ("--connect", neighbours) if neighbours else ()
    return ("--listen", options.bus.endpoint, *connect)


def _sim_arguments(options: CellOptions) -> tuple[str, ...]:
    arguments = ["--world", options.world]
    arguments += ["--speed", "max" if options.speed is None else f"{options.speed:g}"]
    arguments += ["--wait-for", f"{options.robot}/planner"]
    if options.seed is not None:
        arguments += ["--seed", str(options.seed)]
    if options.lockstep:
        arguments.append("--lockstep")
    if options.profile:
        arguments += ["--robot-profile", options.profile]
    return tuple(arguments)


def _planner_arguments(options: CellOptions) -> tuple[str, ...]:
    store = options.state_dir / options.robot / "planner.sqlite"
    return ("--robot", options.robot, "--map", str(world_folder(options.world)), "--store", str(store))


def _gateway_arguments(options: CellOptions) -> tuple[str, ...]:
    return ("--robot", options.robot, "--host", options.http.host, "--port", str(options.http.port))


def world_folder(name: str) -> Path:
    """The folder of a world: one of the user's own, by its path, or one that comes with rackhand, by its name."""
    own = Path(name)
    return own if (own / WORLD_FILE).is_file() else Path(worlds.__path__[0]) / name
