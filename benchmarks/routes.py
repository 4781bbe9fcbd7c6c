"""How exactly a given route is driven in physics, at several speeds, and how a crate on it is passed or waited for."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.progress import track
from benchmarks.report import Report, Table, median
from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.moves import PlanningState
from rackhand.schemas.world import Place, Remove
from rackhand.worlds.world_model import World, load_world
from tests.joined.chassis import JoinedChassis
from tests.joined.world import JoinedWorld
from tests.planner.plant import Array, off_line

SPEEDS = (0.5, 0.8, 1.2)  # m/s
ROUTE = np.array(
    [(3, 1.5), (9.7, 1.5), (9.7, 7.7), (1.1, 7.7), (1.1, 4.75), (9.7, 4.75), (9.7, 1.5), (5.5, 1.5), (5.5, 7.4),
     (8, 7.7), (1.5, 8.1), (1.1, 3)], dtype=float,
)  # fmt: skip
STRAIGHT = np.array([(3.0, 1.5), (9.5, 1.5)])
CRATE, SIZE = (6.0, 1.5), 0.5  # m
FRONT = 0.379  # m from the chassis' origin to its front
TOLERANCE = 0.6  # m
WAITED = 90.0  # s that the crate is there
ON_LINE = 0.05  # m


def run() -> Report:
    length = float(np.hypot(*np.diff(ROUTE, axis=0).T).sum())
    rows = [strict(speed) for speed in track(SPEEDS, "strict route")]
    return Report(
        "Given routes",
        "python -m benchmarks routes",
        ("at most m/s", "median mm", "p95 mm", "worst mm", "s", "contacts"),
        rows,
        f"A strict route of {length:.0f} m with {len(ROUTE) - 2} corners in world `warehouse`, in physics: distance of "
        "the chassis' true origin from the given line, every 0.1 s from the first point on. The localised pose is off "
        "by 1 cm and 5 mrad (1σ), 64 % of the variance wandering over 5 s. Bends up to 20° are rounded within 2 cm.",
        more=[
            Table(
                "A crate on the route",
                ("route", "result"),
                [waiting(), passing()],
                f"A crate of {SIZE} m on a straight line, edges along it; not on the map. Back on the line: within "
                f"{ON_LINE * 100:.0f} cm from there on, measured from the far side of the crate.",
            )
        ],
    )


def strict(speed: float) -> tuple[str, ...]:
    with tempfile.TemporaryDirectory() as folder, JoinedWorld(world(), Path(folder), with_arms=False) as joined:
        chassis = joined.chassis()
        chassis.overlay()
        chassis.set_parameters(max_forward_velocity=speed)
        begun = joined.now()
        off = [gap for _, gap in driven(chassis, post(chassis, ROUTE, 0.0), ROUTE)]
        millimetres = [1e3 * gap for gap in off]
        figures = median(millimetres), float(np.percentile(millimetres, 95)), max(millimetres)
        contacts = joined.inspect().contact_count
        return f"{speed:.1f}", *(f"{one:.0f}" for one in figures), f"{joined.now() - begun:.0f}", str(contacts)


def waiting() -> tuple[str, str]:
    """Strict: the crate is taken away after ``WAITED`` seconds."""
    with tempfile.TemporaryDirectory() as folder, JoinedWorld(world(), Path(folder), with_arms=False) as joined:
        chassis = joined.chassis()
        place_crate(joined)
        move = post(chassis, STRAIGHT, 0.0)
        joined.advance(WAITED)
        gap = CRATE[0] - SIZE / 2 - joined.true_pose("amr1").x - FRONT
        state = chassis.move(move).state
        joined.ask(Remove(name="crate"))
        worst = max(off for _, off in driven(chassis, move, STRAIGHT))
        contacts = joined.inspect().contact_count
    return (
        "strict",
        f"{state} after {WAITED:.0f} s, {gap:.2f} m before the crate; then driven to the end, {worst * 1e3:.0f} mm off "
        f"the line at worst, {contacts} contacts",
    )


def passing() -> tuple[str, str]:
    with tempfile.TemporaryDirectory() as folder, JoinedWorld(world(), Path(folder), with_arms=False) as joined:
        chassis = joined.chassis()
        place_crate(joined)
        trail = driven(chassis, post(chassis, STRAIGHT, TOLERANCE), STRAIGHT)
        away = max((x for x, off in trail if off > ON_LINE), default=math.nan) - CRATE[0] - SIZE / 2
        contacts = joined.inspect().contact_count
    return (
        f"tolerance {TOLERANCE} m",
        f"{max(off for _, off in trail):.3f} m off the line at most, back on it {away:.2f} m behind the crate, "
        f"{contacts} contacts",
    )


def world() -> World:
    """The warehouse without the person, who would cross the routes."""
    return load_world("warehouse").model_copy(update={"movers": {}})


def place_crate(joined: JoinedWorld) -> None:
    joined.ask(Place(name="crate", pose=Pose2(x=CRATE[0], y=CRATE[1], yaw=0.0), size=(SIZE, SIZE, 0.5)))


def post(chassis: JoinedChassis, route: Array, tolerance: float) -> int:
    text = ", ".join(f"{x:g}, {y:g}" for x, y in route)
    return chassis.post(type="along_given_route", route_coordinates=text, detour_tolerance=tolerance)


def driven(chassis: JoinedChassis, move: int, route: Array) -> list[tuple[float, float]]:
    """True x, and distance off the line in metres, every 0.1 s from the first point to the end."""
    trail = []
    while True:
        chassis.world.advance(0.1)
        state, pose = chassis.newest(topics.PLANNING_STATE), chassis.world.true_pose("amr1")
        assert isinstance(state, PlanningState)
        if state.passed_points:
            trail.append((pose.x, off_line(route, np.array([pose.x, pose.y]))))
        if (now := chassis.move(move)).state != "moving":
            if now.state != "succeeded":
                raise RuntimeError(f"route: {now.state}, {now.fail_message}")
            return trail
