"""What is computed between ticks is what the tick would have computed, and none of it once something has changed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.services.controller.trajectory.queue import MotionQueue
from tests.controller.cell import PerfectArm


class Polled(PerfectArm):
    """Looks at its work after every tick, as the service does."""

    def tick(self) -> Any:
        command = super().tick()
        self.controller.poll()
        return command


def driven(kind: type[PerfectArm]) -> list[list[float]]:
    """A path, a longer one appended on the way, a stop in it, and another one: the commands of every tick."""
    cell = kind()
    way: dict[str, Any] = {"command": "appendPath", "type": "joints"}
    cell.ok("a", **way, data=[(cell.arm.home + 0.5).tolist()])
    cell.advance(0.3)
    cell.ok("a", **way, data=[(cell.arm.home - 0.2).tolist(), cell.arm.home.tolist()])
    cell.advance(0.5)
    cell.ok("a", command="softStop")
    cell.advance(0.7)
    cell.ok("a", **way, data=[cell.arm.home.tolist()])
    cell.until_rest()
    return [q.tolist() for _, q, _ in cell.history]


def test_the_same_motion_with_and_without_it() -> None:
    ahead = driven(Polled)
    assert ahead == driven(PerfectArm) and np.ptp(ahead, axis=0).min() > 0.3


def test_the_tick_samples_no_path_that_was_sampled_before(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = Polled()
    cell.ok("a", command="appendPath", type="joints", data=[(cell.arm.home + 0.5).tolist()])
    cell.advance(0.1)
    sampled: list[float] = []
    at = MotionQueue.at
    monkeypatch.setattr(MotionQueue, "at", lambda queue, t: sampled.append(t) or at(queue, t))  # type: ignore[func-returns-value]
    cell._move(cell.command)  # type: ignore[arg-type]
    cell.stamp += 4_000_000
    PerfectArm.tick(cell)
    assert not sampled
    cell.controller.poll()
    assert len(sampled) == 1
