"""A whole cell for a test: all its services as real processes, on free ports, with a state folder of its own."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from types import TracebackType

import yaml

from rackhand.bus import BusConfig
from rackhand.schemas.base import Message
from rackhand.schemas.world import ObjectPose, WorldReply
from rackhand.services.launch.background import START, BackgroundCell
from rackhand.services.launch.processes import PATIENT_LEASE
from rackhand.testing.judge import Judge
from rackhand.testing.world import WorldControl
from rackhand.worlds.data import installed_worlds
from rackhand.worlds.world_model import load_world


class Cell(BackgroundCell, WorldControl):
    """``rackhand up``, started on entry and stopped on exit.

        with Cell(world="warehouse", seed=7) as cell:
            run_my_client(cell.http)
            cell.kill("planner")            # SIGKILL; the supervisor brings it back
            cell.wait_until_up()

    * ``folder``: where its log and state go; a temporary folder if not given.
    * ``options``: further options of ``rackhand up``, as on its command line.
    * ``world``: the name of a world, or a folder with a ``world.yaml``.
    * ``lockstep``: the same seed gives the same run, at any load of the machine. Without it, services run in real
      time, as on hardware.
    * ``speed``: ratio to real time; None: as fast as possible in lockstep, real time without.
    * ``crf``: opens CRF's packet framing, where the world has an arm.
    * ``viewer``: serves the live view. ``environment``: variables for all services.

    ``http``, ``bus`` and ``crf[arm]`` are where clients connect. Methods of ``WorldControl`` act on the world:
    ``advance``, ``place``, ``fault``, ``true_pose``, ``contacts`` and others. Time runs until ``pause`` or ``advance``.
    """

    def __init__(
        self,
        folder: Path | None = None,
        *options: str,
        world: str | Path = "warehouse",
        lockstep: bool = True,
        speed: float | None = None,
        seed: int | None = None,
        crf: bool = True,
        viewer: bool = False,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        self._open = ExitStack()
        given = ["--world", str(world), *(("--viewer-port", "0") if viewer else ("--no-viewer",))]
        given += ["--lockstep"] if lockstep else []
        given += ["--speed", str(speed or ("max" if lockstep else 1))]
        given += ["--seed", str(seed)] if seed is not None else []
        given += ["--crf-port", "0"] if crf and load_world(str(world)).arms else []
        super().__init__(folder or self._temporary(), [*given, *options], environment)

    def __enter__(self) -> Cell:
        self.start()
        try:
            self.wait_until_up(START)
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def stop(self) -> int:
        """Stop all services; returns the supervisor's exit code."""
        with self._open:
            return super().stop()

    @cached_property
    def judge(self) -> Judge:
        """The connection to the simulator that the methods of ``WorldControl`` use."""
        return self._open.enter_context(Judge(self.bus))

    def ask(self, request: Message, timeout: float = 60.0) -> WorldReply:
        return self.judge.ask(request, timeout)

    def objects(self) -> dict[str, ObjectPose]:
        return self.judge.objects()

    def bus_config(self) -> BusConfig:
        """For a ``rackhand.bus.Bus`` of the test's own."""
        return BusConfig(connect=self.bus, lease=PATIENT_LEASE)

    def _temporary(self) -> Path:
        return Path(self._open.enter_context(tempfile.TemporaryDirectory(prefix="rackhand-cell-")))


def without_arms(folder: Path, world: str = "warehouse") -> str:
    """A copy of an installed world in ``folder``, without its arms, for tests that are about driving.

    Arms are commanded 250 times a simulated second; in lockstep a cell that has them takes twice as long.
    """
    copy = folder / world
    shutil.copytree(installed_worlds() / world, copy)
    content = yaml.safe_load((copy / "world.yaml").read_text())
    del content["arms"]
    (copy / "world.yaml").write_text(yaml.safe_dump(content))
    return str(copy)
