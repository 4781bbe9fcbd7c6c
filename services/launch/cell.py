"""Starts a whole cell: checks the options, supervises, reports when it is ready and its addresses."""

from __future__ import annotations

import asyncio
import fcntl
import json
import os
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from rackhand.services.launch.health import ask_health, does_simulator_answer
from rackhand.services.launch.ports import in_the_way, with_port
from rackhand.services.launch.processes import (
    Address,
    CellOptions,
    Process,
    cell_processes,
    served_world,
)
from rackhand.services.launch.supervisor import Supervisor
from rackhand.services.launch.viewing import with_viewer
from rackhand.worlds.arm_model import load_arm_descriptions
from rackhand.worlds.chassis_model import load_profiles
from rackhand.worlds.data import WorldFileError

CELL_FILE = "cell.json"
MAX_PORT = 65535
SLOW_START = 30.0  # seconds after which a cell that is not ready yet is reported


class CannotStart(Exception):
    """Something outside is in the way; the text is for the user."""


def run_cell(options: CellOptions) -> int:
    """Run the cell until a signal ends it. Returns the exit code; raises ``CannotStart`` before anything is started."""
    check_world(options)
    options = replace(options, http=with_port(options.http), bus=with_port(options.bus), crf=crf_addresses(options))
    options, blind = with_viewer(options)
    processes = cell_processes(options, os.environ)
    check_ports(processes)
    with StateFolder(options.state_dir) as state:
        supervisor = Supervisor(
            processes,
            os.environ,
            watch=lambda running: _announce(running, options, blind),
            on_change=lambda pids: state.write(options, pids),
        )
        return asyncio.run(supervisor.run())


def check_world(options: CellOptions) -> None:
    """Raises ``CannotStart`` if there is no such world, or it, its chassis or its arms are not described well."""
    try:
        world = served_world(options)
        load_profiles(world, options.profile)
        load_arm_descriptions(world)
    except WorldFileError as error:
        raise CannotStart(str(error)) from None


def crf_addresses(options: CellOptions) -> dict[str, Address]:
    """Where each arm's CRF clients connect. Raises ``CannotStart`` where there is no arm, or no such port."""
    first = options.crf_port
    if first is None:
        return {}
    arms = served_world(options).arms
    if not arms:
        raise CannotStart(f"--crf-port: there is no arm in world {options.world!r}")
    if first + len(arms) - 1 > MAX_PORT:
        raise CannotStart(f"--crf-port: {len(arms)} arms from {first} on, ports end at {MAX_PORT}")
    numbers = [first + i if first else 0 for i in range(len(arms))]
    return {arm: with_port(Address(options.http.host, n)) for arm, n in zip(arms, numbers, strict=True)}


def check_ports(processes: Sequence[Process]) -> None:
    """Raises ``CannotStart`` if anything already listens where one of these wants to."""
    for process in processes:
        own = ((process.listens, process.option),) if process.listens else ()
        for address, option in (*own, *process.ports):
            if error := in_the_way(address):
                raise CannotStart(
                    f"{process.name} cannot listen on {address}: {error}. "
                    f"Does another cell run? Choose another port with {option}."
                )


class StateFolder:
    """The folder that holds a cell's state, locked to one cell; ``cell.json`` in it has ports and pids."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = -1

    def __enter__(self) -> StateFolder:
        try:
            self._path.mkdir(parents=True, exist_ok=True)
            self._lock = os.open(self._path / "cell.lock", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._lock)
            raise CannotStart(
                f"another cell runs on the state folder {self._path}. Choose another with --state-dir."
            ) from None
        except OSError as error:
            raise CannotStart(f"the state folder {self._path} cannot be used: {error.strerror}") from None
        return self

    def __exit__(self, *_: object) -> None:
        with suppress(FileNotFoundError):
            (self._path / CELL_FILE).unlink()
        os.close(self._lock)

    def write(self, options: CellOptions, pids: dict[str, int]) -> None:
        """Written whole or not at all: a reader never sees half of it."""
        crf = {arm: str(address) for arm, address in options.crf.items()}
        facts = {"http": options.http.url, "bus": options.bus.endpoint, **({"crf": crf} if crf else {}), "pids": pids}
        if options.viewer_page is not None:
            facts |= {"viewer": options.viewer_page, "viewer_stream": options.viewer_stream}
        fresh = self._path / f"{CELL_FILE}.new"
        fresh.write_text(json.dumps(facts, indent=2) + "\n")
        fresh.replace(self._path / CELL_FILE)


async def _announce(running: Supervisor, options: CellOptions, blind: str) -> None:
    """Wait until every service is up, then print the addresses. While that takes long, print what is missing."""
    if blind:
        running.say(blind)
    begun = time.monotonic()
    complain_at = begun + SLOW_START
    while True:
        missing = await asyncio.to_thread(_missing, options)
        if not missing:
            break
        waited = time.monotonic() - begun
        running.show_status(f"starting, {waited:.0f} s: {missing}")
        if time.monotonic() > complain_at:
            complain_at += SLOW_START
            running.say(f"not ready after {waited:.0f} s: {missing}")
        await asyncio.sleep(0.2)
    running.show_status("")
    running.say(f"ready after {time.monotonic() - begun:.1f} s; Ctrl-C stops the cell")
    for what, where in _places(options):
        running.say(f"  {what:<10} {where}")


def _missing(options: CellOptions) -> str:
    """What the cell still waits for; empty when it is ready for its clients."""
    health = ask_health(options.http.url)
    if health is None:
        return "the gateway does not answer"
    if not health.all_up:
        return "waiting for " + ", ".join(health.down)
    if options.sim and not does_simulator_answer(options.http.url):
        return "the simulator does not answer requests yet"
    return ""


def _places(options: CellOptions) -> tuple[tuple[str, str], ...]:
    url = options.http.url
    return (
        ("page", f"{url}/"),
        *((("live view", options.viewer_page),) if options.viewer_page is not None else ()),
        ("API docs", f"{url}/docs"),
        ("health", f"{url}/healthz"),
        ("WebSocket", f"{url.replace('http', 'ws', 1)}/ws/v2/topics"),
        *((f"CRF {arm}", str(address)) for arm, address in options.crf.items()),
        ("bus", options.bus.endpoint),
        ("state", str(options.state_dir)),
    )
