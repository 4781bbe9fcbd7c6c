"""The cell that the scenarios of one world run in, one after another: in lockstep, paused, without arms."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any

from rackhand.bus import Bus
from rackhand.schemas import topics
from rackhand.schemas.base import Message, Pose2
from rackhand.schemas.lift import LiftRequest
from rackhand.schemas.maps import MapRequest, SelectMap
from rackhand.schemas.service import CELL, ServiceId
from rackhand.schemas.world import WorldReply
from rackhand.testing import Cell, without_arms
from rackhand.worlds.data import installed_worlds
from rackhand.worlds.world_model import load_world

Json = dict[str, Any]
CLIENT = "scenario"


class ScenarioCell:
    """A cell of a world's chassis on free ports, without arms, which would make it half as fast in lockstep."""

    def __init__(self, world: str, folder: Path | None = None) -> None:
        """``folder``: where its log and state are kept; by default they end with it."""
        self._world, self._folder = world, folder
        self._open = ExitStack()
        self._poses: dict[str, Pose2] = {}

    def __enter__(self) -> ScenarioCell:
        with ExitStack() as opened:
            folder = Path(opened.enter_context(TemporaryDirectory(prefix="rackhand-scenarios-")))
            installed = (installed_worlds() / self._world).is_dir()
            has_arms = bool(load_world(self._world).arms)
            world = without_arms(folder, self._world) if installed and has_arms else self._world
            self._cell = opened.enter_context(Cell(self._folder or folder / "cell", world=world, crf=False))
            self.http = self._cell.http
            self._bus = opened.enter_context(Bus(ServiceId(CLIENT, CELL), self._cell.bus_config()))
            self._open = opened.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._open.close()

    def ask(self, request: Message, timeout: float = 60.0) -> WorldReply:
        self._poses = {}
        return self._cell.ask(request, timeout)

    def true_pose(self, name: str) -> Pose2:
        """Ground truth as of the newest publication; asking twice about a paused world waits for no other one."""
        if not self._poses:
            self._poses = self._cell.true_poses()
        return self._poses[name]

    def use_no_map(self, robot: str) -> None:
        """Let that robot's planner use no map, which no request over HTTP can."""
        self._bus.call(topics.MAPS, MapRequest(request=SelectMap()), robot)

    def ask_lift(self, lift: str, fields: Json) -> None:
        """One of the requests of ``rackhand.schemas.lift``, as a client of its own."""
        request = LiftRequest.model_validate({"request": {"client": CLIENT, **fields}})
        self._bus.call(topics.LIFT, request, lift)

    def restart(self, service: str) -> None:
        former = self._cell.kill(service)
        self._cell.wait_until_restarted(service, former)
        self._cell.wait_until_up()

    def tail(self) -> str:
        """The last lines of the log of all processes."""
        return self._cell.tail()
