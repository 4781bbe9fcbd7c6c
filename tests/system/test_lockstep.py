"""The same seed gives the same world, whatever else the machine does."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from rackhand.schemas.base import Pose2
from rackhand.schemas.world import Pause, Place, Reset
from rackhand.testing import Cell, Judge, without_arms
from tests.system.driving import Driver, standard

MakeCell = Callable[..., Cell]
SECONDS = 20.0


def drive(cell: Cell, seed: int) -> tuple[str, str]:
    """A world begun anew, a crate, a move across the hall: the digest after so long, and the state of the move."""
    with Judge(cell.bus) as judge:
        driver = Driver(cell, judge)
        judge.ask(Pause(paused=True))
        run = judge.inspect().clock.run
        judge.ask(Reset(seed=seed))
        driver.wait(lambda world: world.clock.run != run and world.clock.stamp == 0, "another run")
        driver.wait_until_joined()
        judge.ask(Place(name="crate", pose=Pose2(x=6.2, y=1.8, yaw=0.3), size=(0.4, 0.4, 0.5)))
        move = driver.post(standard(9.6, 1.2, 1.57))
        world = judge.advance(SECONDS)
        assert world.clock.stamp == round(SECONDS * 1e9)
        state = driver.move(move)["state"]
        driver.close()
        return world.digest, state


@contextmanager
def busy_machine() -> Iterator[None]:
    """Every core kept at work by somebody else."""
    context = multiprocessing.get_context("spawn")
    others = [context.Process(target=spin, daemon=True) for _ in range(os.cpu_count() or 2)]
    for process in others:
        process.start()
    try:
        yield
    finally:
        for process in others:
            process.kill()
            process.join()


def spin() -> None:
    parent = os.getppid()
    while os.getppid() == parent:
        sum(range(100_000))


def test_two_runs_of_one_seed_are_the_same_also_on_a_busy_machine(make_cell: MakeCell, tmp_path: Path) -> None:
    world = without_arms(tmp_path)
    one = make_cell(world=world, seed=3)
    first, state = drive(one, seed=3)
    again, _ = drive(one, seed=3)
    assert state == "succeeded"
    assert again == first, "the same cell, begun anew"
    with busy_machine():
        elsewhere, _ = drive(make_cell(world=world, seed=3), seed=3)
    assert elsewhere == first, "another cell, on a busy machine"


def test_another_seed_is_another_run(make_cell: MakeCell, tmp_path: Path) -> None:
    cell = make_cell(world=without_arms(tmp_path))
    assert drive(cell, seed=1)[0] != drive(cell, seed=2)[0]
