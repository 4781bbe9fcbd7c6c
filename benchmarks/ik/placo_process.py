"""The other end of ``placo_worker``: makes its environment when it is first wanted, and asks it."""

from __future__ import annotations

import pickle
import subprocess
import sys
import venv
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

from benchmarks.ik.search import Found, Pair
from benchmarks.ik.urdf import to_urdf
from benchmarks.ik.walk import Chunk, Course
from rackhand.services.controller.ik import Arm

ROOT = Path(__file__).parents[2]
ENVIRONMENT = ROOT / ".venv-placo"
PACKAGES = ("placo==0.10.2", "scipy>=1.17,<2")  # brings pin 3.8, which excludes ours


class PlacoMissing(Exception):
    """There is no environment for placo, and none could be made."""


def python() -> Path:
    """The interpreter of placo's environment, made if it is not there."""
    made, executable = ENVIRONMENT / ".made", ENVIRONMENT / "bin" / "python"
    if not made.exists():
        print(f"making {ENVIRONMENT.name} for placo (once; a minute)", file=sys.stderr, flush=True)
        venv.create(ENVIRONMENT, with_pip=True, clear=True)
        pip = [str(executable), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PACKAGES]
        if (done := subprocess.run(pip, capture_output=True, text=True, check=False)).returncode:
            raise PlacoMissing((done.stderr.strip().splitlines() or ["pip failed"])[-1])
        made.touch()
    return executable


class PlacoProcess:
    """Raises ``PlacoMissing`` when it cannot be had."""

    def __enter__(self) -> PlacoProcess:
        argv = [str(python()), "-m", "benchmarks.ik.placo_worker"]
        self._process = subprocess.Popen(argv, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait(10)

    def take_arm(self, arm: Arm) -> None:
        self._ask("arm", (to_urdf(arm), list(arm.joints), arm.home, arm.limits.lower, arm.limits.upper))

    def take_course(self, course: Course) -> None:
        self._ask("course", course)

    def walk(self, first: int) -> list[Chunk]:
        """The floor's and placo's steps."""
        chunks: list[Chunk] = self._ask("walk", first)
        return chunks

    def search(self, pairs: Sequence[Pair]) -> list[Found]:
        found: list[Found] = self._ask("search", list(pairs))
        return found

    def _ask(self, kind: str, content: object) -> Any:
        assert self._process.stdin is not None and self._process.stdout is not None
        try:
            pickle.dump((kind, content), self._process.stdin)
            self._process.stdin.flush()
            return pickle.load(self._process.stdout)
        except (EOFError, BrokenPipeError) as gone:
            raise PlacoMissing("its process has ended; what it said stands above") from gone
