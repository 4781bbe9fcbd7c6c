"""Round trips of a chassis by lift to the other floor and back, in physics, each with its own seed."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.progress import say, track
from benchmarks.report import Report, median
from rackhand.schemas.base import Pose2
from rackhand.schemas.moves import Move
from rackhand.schemas.planar import as_tuple, transform
from rackhand.schemas.world import MoveRobot
from rackhand.services.planner.geometry.polygon import convex_overlap
from rackhand.services.sim.mjcf.lift_model import LEAVES, leaf_name
from rackhand.worlds.world_model import load_world
from tests.joined.lifts import HOLD_PERIOD, LiftUser
from tests.joined.world import JoinedWorld

Array = NDArray[np.float64]
TRIPS = 10
START_X, START_Y = (13.0, 17.0), (1.5, 7.0)  # m, of the chassis before a trip, any heading
BODY = (0.375, 0.23)  # m, half of the chassis
WATCH_PERIOD = 0.08  # s
FLOORS = ("floor1", "floor2")


@dataclass
class Trip:
    """``clearance``: least distance (m) of the true body from a leaf of a door; ``seconds`` of simulation time."""

    moves: list[Move] = field(default_factory=list)
    clearance: float = math.inf
    contacts: int = 0
    seconds: float = 0.0

    @property
    def succeeded(self) -> bool:
        return bool(self.moves) and all(move.state == "succeeded" for move in self.moves)


class Watched(LiftUser):
    """Measures the clearance to the doors while the chassis moves."""

    clearance = math.inf

    def _advance(self) -> None:
        for _ in range(round(HOLD_PERIOD / WATCH_PERIOD)):
            self.world.advance(WATCH_PERIOD)
            body = _body(self.world.true_pose(self.driver.name))
            self.clearance = min(self.clearance, *(gap(body, leaf) for leaf in self._leaves()))

    def _leaves(self) -> list[Array]:
        data, model = self.world.simulation.data, self.world.simulation.model
        found = []
        for floor in FLOORS:
            for leaf in LEAVES:
                geom = data.geom(leaf_name(self.lift, floor, leaf))
                half = model.geom(leaf_name(self.lift, floor, leaf)).size[:2]
                axes = geom.xmat.reshape(3, 3)[:2, :2]
                corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * half
                found.append(corners @ axes.T + geom.xpos[:2])
        return found


def run() -> Report:
    trips = [trip(seed) for seed in track(range(TRIPS), "round trips by lift")]
    return Report(
        "Riding a lift",
        "python -m benchmarks lift",
        ("trips", "succeeded", "contacts", "clearance to a door cm: least", "median", "trip s: median", "longest"),
        [_row(trips)],
        f"World `warehouse`, seeds 0 to {TRIPS - 1}, in physics. From a random pose to the waiting point, into the "
        "cabin, up, out, and the same back: two `enter_elevator` and three `standard` moves a trip. A client calls "
        "the lift, holds its door and changes the map. Contacts are all that the physics counts, clearances those of "
        "the true body to the leaves of all doors.",
    )


def trip(seed: int) -> Trip:
    random = np.random.default_rng(seed)
    result = Trip()
    alone = load_world("warehouse").model_copy(update={"movers": {}})
    with tempfile.TemporaryDirectory() as folder, JoinedWorld(alone, Path(folder), seed, with_arms=False) as world:
        user = Watched(world.chassis())
        start = Pose2(x=random.uniform(*START_X), y=random.uniform(*START_Y), yaw=random.uniform(-math.pi, math.pi))
        world.ask(MoveRobot(robot="amr1", pose=start))
        world.advance(0.6)
        begun = world.now()
        result.moves.append(user.finish(user.leave(FLOORS[0]), hold=False))
        result.moves += user.round_trip(*FLOORS)
        result.seconds, result.clearance = world.now() - begun, user.clearance
        result.contacts = world.inspect().contact_count
    for move in result.moves:
        if move.state != "succeeded":
            say(f"seed {seed}: {move.type} {move.state} {move.fail_reason}: {move.fail_message}")
    return result


def _row(trips: Sequence[Trip]) -> tuple[str, ...]:
    seconds = [one.seconds for one in trips]
    clearances = [100.0 * one.clearance for one in trips]
    done = sum(one.succeeded for one in trips)
    return (
        str(len(trips)),
        f"{done} of {len(trips)}",
        str(sum(one.contacts for one in trips)),
        f"{min(clearances):.1f}",
        f"{median(clearances):.1f}",
        f"{median(seconds):.0f}",
        f"{max(seconds):.0f}",
    )


def _body(pose: Pose2) -> Array:
    x, y = BODY
    return np.array([transform(as_tuple(pose), a * x, b * y) for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1))])


def gap(one: Array, other: Array) -> float:
    """Metres between two convex polygons, (n, 2) and (m, 2); 0 where they overlap."""
    if convex_overlap(one, other):
        return 0.0
    return min(_corners_to_sides(one, other), _corners_to_sides(other, one))


def _corners_to_sides(corners: Array, polygon: Array) -> float:
    sides = np.roll(polygon, -1, axis=0) - polygon
    away = corners[:, None, :] - polygon
    share = np.clip(np.sum(away * sides, axis=2) / np.sum(sides * sides, axis=1), 0.0, 1.0)
    return float(np.hypot(*np.moveaxis(away - share[..., None] * sides, 2, 0)).min())
