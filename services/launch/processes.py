"""The cell as data: one row a process. Adding a service is adding a row to ``cell_processes``."""

from __future__ import annotations

import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from rackhand.schemas.service import DRIVER
from rackhand.worlds.arm_model import load_arm_descriptions, with_arm_kind
from rackhand.worlds.data import WorldFileError
from rackhand.worlds.world_model import World, load_world, world_directory

CONTROLLER_RATE = 250  # Hz
PATIENT_LEASE = 30.0  # s of silence after which a process of a cell in lockstep counts as gone: see BusConfig


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
    laid over the supervisor's own environment; ``option`` is what a user changes when the address is taken. ``ports``
    are further addresses it listens on, each with that option. The cell goes on without an ``optional`` process.
    """

    name: str
    argv: tuple[str, ...]
    needs: tuple[str, ...] = ()
    listens: Address | None = None
    option: str = ""
    ports: tuple[tuple[Address, str], ...] = ()
    env: Mapping[str, str] = field(default_factory=dict)
    optional: bool = False


@dataclass(frozen=True)
class CellOptions:
    """The options of ``rackhand up``. ``speed`` None is as fast as possible; ``world`` is a name or a folder.

    ``seed``, ``profile`` and ``arm`` (the kind of every arm) are the world's own where None. ``crf_port`` is for CRF's
    packet framing to the first arm, the next ports are for the next arms; where each arm listens in the end is in
    ``crf``. ``viewer`` is where the live view's page is, None for no live view; its data come from ``viewer_data``.
    ``robots`` are those of the world's chassis and arms that the cell serves, all of them if none is named. Without
    ``sim``, something else drives them: each needs a driver on the bus.
    """

    world: str = "warehouse"
    speed: float | None = 1.0
    lockstep: bool = False
    seed: int | None = None
    http: Address = Address("127.0.0.1", 8090)
    bus: Address = Address("127.0.0.1", 7447)
    crf_port: int | None = None
    crf: Mapping[str, Address] = field(default_factory=dict)
    profile: str | None = None
    arm: str | None = None
    viewer: Address | None = Address("127.0.0.1", 9090)
    viewer_data: Address = Address("127.0.0.1", 9876)
    state_dir: Path = Path("var")
    robots: tuple[str, ...] = ()
    sim: bool = True

    @property
    def viewer_page(self) -> str | None:
        """What a browser opens to see the cell live."""
        return f"{self.viewer.url}/" if self.viewer is not None else None

    @property
    def viewer_stream(self) -> str:
        """What Rerun's native viewer opens."""
        return f"rerun+http://{self.viewer_data}/proxy"


def cell_processes(options: CellOptions, environment: Mapping[str, str]) -> tuple[Process, ...]:
    """The process table. ``environment`` is the user's: bus endpoints named there become the router's neighbours.

    Raises ``WorldFileError``.
    """
    lease = {"RACKHAND_BUS_LEASE": f"{PATIENT_LEASE:g}"} if options.lockstep else {}
    bus = {"RACKHAND_BUS_CONNECT": options.bus.endpoint, **lease}
    world = served_world(options)
    return (
        Process(
            "router",
            _module("rackhand.bus.router", *_router_arguments(options, environment.get("RACKHAND_BUS_CONNECT", ""))),
            listens=options.bus,
            option="--bus-port",
            env=lease,
        ),
        *_simulator(options, world, bus),
        *(
            Process(
                _row_name("planner", robot, world.robots),
                _module("rackhand.services.planner", *_planner_arguments(options, robot)),
                needs=("router",),
                env=bus,
            )
            for robot in world.robots
        ),
        *(
            Process(
                _row_name("controller", arm, world.arms),
                _module("rackhand.services.controller", *_controller_arguments(options, arm, place.kind)),
                needs=("router",),
                env=bus,
            )
            for arm, place in world.arms.items()
        ),
        Process(
            "gateway",
            _module("rackhand.services.gateway", *_gateway_arguments(options, world)),
            needs=("router",),
            listens=options.http,
            option="--port",
            env=bus,
            ports=tuple((address, "--crf-port") for address in options.crf.values()),
        ),
        *_viewer(options, bus),
    )


def served_world(options: CellOptions) -> World:
    """The world with the robots that the cell serves. Raises ``WorldFileError``."""
    world = with_arm_kind(load_world(options.world), options.arm)
    load_arm_descriptions(world)
    if not options.robots:
        return world
    if unknown := sorted(set(options.robots) - {*world.robots, *world.arms}):
        raise WorldFileError(f"--robot {unknown[0]}: robots of {world.name} are {sorted([*world.robots, *world.arms])}")
    robots = {name: place for name, place in world.robots.items() if name in options.robots}
    arms = {name: place for name, place in world.arms.items() if name in options.robots}
    return world.model_copy(update={"robots": robots, "arms": arms})


def _simulator(options: CellOptions, world: World, bus: Mapping[str, str]) -> tuple[Process, ...]:
    if not options.sim:
        return ()
    command = _module("rackhand.services.sim", *_sim_arguments(options, world))
    return (Process("sim", command, needs=("router",), env=bus),)


def _viewer(options: CellOptions, bus: Mapping[str, str]) -> tuple[Process, ...]:
    if options.viewer is None:
        return ()
    page, data = options.viewer, options.viewer_data
    arguments = ("--host", page.host, "--web-port", str(page.port), "--data-port", str(data.port))
    command = _module("rackhand.services.viewer", *arguments)
    return (Process("viewer", command, ("router",), page, "--viewer-port", env=bus, optional=True),)


def _row_name(service: str, robot: str, all_robots: Collection[str]) -> str:
    """The robot is in the name only where there are several."""
    return service if len(all_robots) == 1 else f"{service}-{robot}"


def _module(module: str, *arguments: str) -> tuple[str, ...]:
    return (sys.executable, "-m", module, *arguments)


def _router_arguments(options: CellOptions, neighbours: str) -> tuple[str, ...]:
    connect = ("--connect", neighbours) if neighbours else ()
    return ("--listen", options.bus.endpoint, *connect)


def _sim_arguments(options: CellOptions, world: World) -> tuple[str, ...]:
    arguments = ["--world", options.world]
    arguments += ["--speed", "max" if options.speed is None else f"{options.speed:g}"]
    for participant in _participants(world):
        arguments += ["--wait-for", participant]
    if options.seed is not None:
        arguments += ["--seed", str(options.seed)]
    if options.lockstep:
        arguments.append("--lockstep")
    if options.profile:
        arguments += ["--robot-profile", options.profile]
    if options.arm:
        arguments += ["--arm", options.arm]
    return tuple(arguments)


def _participants(world: World) -> list[str]:
    return [*(f"{robot}/planner" for robot in world.robots), *(f"{arm}/controller" for arm in world.arms)]


def _planner_arguments(options: CellOptions, robot: str) -> tuple[str, ...]:
    store = options.state_dir / robot / "planner.sqlite"
    return ("--robot", robot, "--map", str(world_directory(options.world)), "--store", str(store))


def _controller_arguments(options: CellOptions, arm: str, kind: str) -> tuple[str, ...]:
    state = options.state_dir / arm
    place = ("--robot", arm, "--arm", kind, "--world", options.world)
    return (*place, "--state-dir", str(state), "--rate", str(CONTROLLER_RATE))


def _gateway_arguments(options: CellOptions, world: World) -> tuple[str, ...]:
    """The gateway serves every robot, the first as the default one, and is healthy when all that move are up."""
    arguments = ["--host", options.http.host, "--port", str(options.http.port)]
    for robot in world.robots:
        arguments += ["--robot", robot]
    for arm in world.arms:
        arguments += ["--arm", arm]
    for arm, address in options.crf.items():
        arguments += ["--crf-port", f"{arm}={address.port}"]
    drivers = ["world/sim"] if options.sim else [f"{robot}/{DRIVER}" for robot in (*world.robots, *world.arms)]
    for service in ("cell/router", *drivers, *_participants(world)):
        arguments += ["--expect", service]
    return tuple(arguments)
