"""How exactly, and how fast, a chassis docks: under racks that are off their points, onto chargers off theirs."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.progress import track
from benchmarks.report import Report, Table, median, percentile
from rackhand.schemas import planar
from rackhand.schemas.base import Pose2
from rackhand.schemas.world import MoveRobot
from rackhand.worlds.world_model import Charger, World, load_world
from tests.joined.chassis import Json
from tests.joined.racks import hall_with_racks, rack_point
from tests.joined.world import JoinedWorld

RUNS, CHARGES = 50, 20
OFF, TURNED = 0.05, math.radians(4)  # of a rack off its point, at most
FROM = 3.0  # m before the point
CHARGER_OFF, CHARGER_TURNED = 0.3, math.radians(10)
DOCK = (-3.0, 0.0, 0.0)  # of the charger's docked pose
BACK = 0.6  # m from the docked pose back to the charger

COLUMNS = ("succeeded", *(f"{what}, median / worst" for what in ("lateral mm", "yaw mrad", "along mm", "s")))
Row = tuple[float, float, float, float]  # x, y, yaw off the docked pose, and seconds


def run() -> Report:
    rows: dict[str, list[Row]] = {"standard": [], "large": []}
    failed: list[str] = []
    for seed in track(range(RUNS), "align_with_rack"):
        kind = ("standard", "large")[seed % 2]
        outcome = align(kind, seed)
        if isinstance(outcome, str):
            failed.append(outcome)
        else:
            rows[kind].append(outcome)
    return Report(
        "Docking: under a rack",
        "python -m benchmarks align",
        ("rack", *COLUMNS),
        [_row(kind, found, RUNS // 2) for kind, found in rows.items()],
        f"`align_with_rack` in physics, {RUNS} seeded runs: racks up to {100 * OFF:.0f} cm and "
        f"{math.degrees(TURNED):.0f}° off their points, the chassis {FROM:.0f} m before the point and up to 0.3 m and "
        "0.5 rad off its axis, 1 cm of noise on the scan, the localised pose off by 1 cm and 5 mrad (1σ). Errors are "
        "of the chassis' true pose under the rack; times are of simulation." + _failures(failed),
        more=[charging()],
    )  # fmt: skip


def align(kind: str, seed: int) -> Row | str:
    random = np.random.default_rng(seed)
    rack = random.uniform(-1, 1, 3) * (OFF, OFF, TURNED)
    world = hall_with_racks(rack=(kind, *rack.tolist()))
    start = (-FROM, random.uniform(-0.3, 0.3), random.uniform(-0.5, 0.5))
    move = {"type": "align_with_rack", "target_x": 0.0, "target_y": 0.0}
    return _docked(world, seed, [rack_point("a", 0.0, 0.0, 0.0)], start, move, (rack[0], rack[1], rack[2]))


def charging() -> Table:
    """From anywhere before a charger that is off its registered pose."""
    rows: list[Row] = []
    failed: list[str] = []
    for seed in track(range(CHARGES), "charge"):
        random = np.random.default_rng(seed)
        angle, share = random.uniform(0, math.tau), math.sqrt(random.uniform())
        off = (CHARGER_OFF * share * math.cos(angle), CHARGER_OFF * share * math.sin(angle))
        yaw = math.degrees(CHARGER_TURNED * random.uniform(-1, 1))
        start = (random.uniform(-1.8, 1.5), random.uniform(-1.5, 1.5), random.uniform(-math.pi, math.pi))
        overlay = charger_point("c", DOCK[0] + off[0], DOCK[1] + off[1], yaw)
        outcome = _docked(hall_with_charger(), seed, [overlay], start, {"type": "charge"}, DOCK)
        if isinstance(outcome, str):
            failed.append(outcome)
        else:
            rows.append(outcome)
    return Table(
        "Docking: onto a charger",
        ("dock", *COLUMNS),
        [_row("V of two plates", rows, CHARGES)],
        f"`charge`, {CHARGES} seeded start poses, the dock up to {100 * CHARGER_OFF:.0f} cm and "
        f"{math.degrees(CHARGER_TURNED):.0f}° off its registered pose; driven backward at 0.2 m/s." + _failures(failed),
    )  # fmt: skip


def hall_with_charger() -> World:
    """The empty hall with a charger that looks along x."""
    charger = Charger(pose=(DOCK[0] - BACK, DOCK[1], DOCK[2]), dock=DOCK)
    return load_world("empty").model_copy(update={"chargers": {"charger": charger}})


def charger_point(name: str, x: float, y: float, degrees: float) -> Json:
    """The overlay of a charger."""
    properties = {"type": "9", "name": name, "yaw": degrees}
    geometry = {"type": "Point", "coordinates": [x, y]}
    return {"type": "Feature", "id": f"id_{name}", "geometry": geometry, "properties": properties}


def _docked(
    world: World, seed: int, overlays: Sequence[Json], start: tuple[float, ...], move: Json, docked: planar.PlanarPose
) -> Row | str:
    """Where the chassis ended, off the docked pose, and how long it took; why it failed."""
    with (
        tempfile.TemporaryDirectory() as folder,
        JoinedWorld(world, Path(folder), seed=seed, with_arms=False) as joined,
    ):
        driver = joined.chassis()
        driver.overlay(*overlays)
        joined.ask(MoveRobot(robot=driver.name, pose=Pose2(x=start[0], y=start[1], yaw=start[2])))
        joined.advance(0.5)
        begun = joined.now()
        ended = driver.drive(move)
        if ended.state != "succeeded" or joined.inspect().contact_count:
            return f"seed {seed}: {ended.state} {ended.fail_message}, {joined.inspect().contact_count} contacts"
        pose = joined.true_pose(driver.name)
        x, y, yaw = planar.between(docked, planar.as_tuple(pose))
        return x, y, yaw, joined.now() - begun


def _row(name: str, rows: Sequence[Row], of: int) -> tuple[str, ...]:
    if not rows:
        return name, f"0 of {of}", "", "", "", ""
    x, y, yaw, seconds = (np.abs(column).tolist() for column in np.array(rows).T)
    millis = [f"{1e3 * median(v):.1f} / {1e3 * percentile(v, 1.0):.1f}" for v in (y, yaw, x)]
    return name, f"{len(rows)} of {of}", *millis, f"{median(seconds):.1f} / {percentile(seconds, 1.0):.1f}"


def _failures(failed: Sequence[str]) -> str:
    return "" if not failed else " Failed: " + "; ".join(failed) + "."
