"""Rack jobs in physics: fetch a rack, carry it to a point or an area, put it down and leave, from points and areas."""

from __future__ import annotations

import math
import random
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from benchmarks.progress import track
from benchmarks.report import Report, median
from rackhand.schemas import planar
from rackhand.schemas.chassis import JackRequest
from rackhand.schemas.maps import PointType
from rackhand.schemas.world import Touch
from rackhand.services.planner.load import LoadState
from rackhand.services.planner.map.overlays import MapOverlays, PointOfInterest, Zone
from rackhand.testing import turn
from rackhand.worlds.scatter import scattered
from rackhand.worlds.world_model import World, load_world
from tests.joined.chassis import JoinedChassis
from tests.joined.world import JoinedWorld

Sort = Literal["point to point", "point to area", "area to area"]
SORTS: tuple[Sort, ...] = ("point to point", "point to area", "area to area")
KINDS = ("standard", "large")
SEEDS = range(10)
OFF, TURNED = 0.05, math.radians(4.0)  # of racks off their points
AT_POINT = 0.5  # m from a rack point, within which a rack stands at it
BACK = 1.6  # m before a rack, where the chassis goes when it leaves
STROKE = 15.0  # s, within which a stroke of the jack must end


@dataclass
class Job:
    """One job and what came of it. Seconds of simulation time, metres and degrees; ``touched``: pairs of parts that
    must not touch; ``trouble``: why it failed, empty when it succeeded."""

    sort: Sort
    kind: str
    seed: int
    align: float = math.nan
    unload: float = math.nan
    whole: float = math.nan
    away: float = math.nan
    turned: float = math.nan
    touched: list[str] = field(default_factory=list)
    trouble: str = ""


class _Failed(Exception):
    """A move of a job failed."""


def run() -> Report:
    jobs = [Job(sort, kind, seed) for sort in SORTS for kind in KINDS for seed in SEEDS]
    done = [carry_out(job) for job in track(jobs, "rack jobs")]
    return report(done)


def report(jobs: Sequence[Job]) -> Report:
    rows = [_row(sort, kind, jobs) for sort in SORTS for kind in KINDS]
    good = [job for job in jobs if not job.trouble]
    faults = "; ".join(f"{j.sort}, {j.kind}, seed {j.seed}: {j.trouble}" for j in jobs if j.trouble) or "none"
    touched = sorted({pair for job in jobs for pair in job.touched})
    return Report(
        "Rack jobs",
        "python -m benchmarks rack_jobs",
        ("job", "rack", "succeeded", "error mm", "error degrees", "align s", "carry s", "whole job s"),
        rows,
        f"World `warehouse` in lockstep without people, planner core and physics in one process, racks up to "
        f"{OFF * 100:.0f} cm and {math.degrees(TURNED):.0f}° off their points (seeded), scan noise 1 cm. A job: "
        "`align_with_rack`, `jack_up`, `to_unload_point`, `jack_down`, a move away; the chassis begins at the charger. "
        "Error: true pose of the rack at the end off the rack point, median / worst. Times are medians of simulation "
        f"time. Over all: {len(good)} of {len(jobs)} succeeded, error {_spread([1e3 * j.away for j in good], 1)} mm "
        f"and {_spread([j.turned for j in good], 2)}°. Failures: {faults}. Contacts by the physics other than "
        f"jack–rack, wheels–floor, rack–floor and items–rack: {', '.join(touched) or 'none'}.",
    )


def _row(sort: Sort, kind: str, jobs: Iterable[Job]) -> tuple[str, ...]:
    mine = [job for job in jobs if (job.sort, job.kind) == (sort, kind)]
    good = [job for job in mine if not job.trouble]
    times = [
        f"{median([getattr(job, name) for job in good]):.1f}" if good else "" for name in ("align", "unload", "whole")
    ]
    away, turned = _spread([1e3 * job.away for job in good], 1), _spread([job.turned for job in good], 2)
    return sort, kind, f"{len(good)} of {len(mine)}", away, turned, *times


def _spread(values: Sequence[float], digits: int) -> str:
    return f"{median(values):.{digits}f} / {max(values):.{digits}f}" if values else ""


# -- one job -----------------------------------------------------------------------------------------------------------


def carry_out(job: Job) -> Job:
    """Fills in what came of the job."""
    chance = random.Random(f"{job.sort} {job.kind} {job.seed}")
    world = scattered(_without_distractions(load_world("warehouse")), job.seed, OFF, TURNED)
    source_area = chance.choice(("storage", "picking"))
    if job.sort == "area to area":
        world = _only(world, job.kind, source_area)
    with tempfile.TemporaryDirectory() as folder, JoinedWorld(world, Path(folder), seed=job.seed) as joined:
        joined.advance(0.4)
        try:
            _carry(job, joined.chassis(), chance, source_area)
        except (_Failed, AssertionError) as failed:
            job.trouble = str(failed)[:300]
        job.touched = forbidden(joined.inspect().touches, world)
        if job.touched and not job.trouble:
            job.trouble = f"contacts: {', '.join(job.touched)}"
    return job


def _carry(job: Job, driver: JoinedChassis, chance: random.Random, source_area: str) -> None:
    overlays, world = _overlays(driver), driver.world
    racks = _racks_at_points(driver, overlays)
    free = [point for point in overlays.points_of(PointType.RACK) if point.id not in racks]
    own = sorted(id_ for id_, name in racks.items() if world.session.simulation.world.racks[name].kind == job.kind)
    source = overlays.point(chance.choice(own))
    assert source is not None
    if job.sort == "area to area":
        align: dict[str, Any] = {"rack_area_id": _area(overlays, source_area).id}
        to = "picking" if source_area == "storage" else "storage"
    else:
        align = {"target_x": source.x, "target_y": source.y}
        to = "picking" if _area(overlays, "storage").contains(source.x, source.y) else "storage"
    goal = chance.choice(free)
    unload = (
        {"target_x": goal.x, "target_y": goal.y}
        if job.sort == "point to point"
        else {"rack_area_id": _area(overlays, to).id}
    )
    begun = world.now()
    job.align = _move(driver, type="align_with_rack", **align)
    rack = _nearest_rack(driver)
    _jack(driver, "up", LoadState.CARRYING)
    job.unload = _move(driver, type="to_unload_point", **unload)
    _jack(driver, "down", LoadState.UNDER_RACK)
    chassis = world.true_pose(driver.name)
    x, y, _ = planar.compose(planar.as_tuple(chassis), (-BACK, 0.0, 0.0))
    _move(driver, type="standard", target_x=x, target_y=y)
    job.whole = world.now() - begun
    _judge(job, driver, rack, goal if job.sort == "point to point" else None, free, _area(overlays, to))


def _move(driver: JoinedChassis, **body: Any) -> float:
    """Seconds that a move took; raises ``_Failed``."""
    begun = driver.world.now()
    move = driver.finish(driver.post(body))
    if move.state != "succeeded":
        raise _Failed(f"{move.type}: {move.fail_reason} {move.fail_message}")
    return driver.world.now() - begun


def _jack(driver: JoinedChassis, direction: Literal["up", "down"], then: LoadState) -> None:
    driver.ask(JackRequest(direction=direction))
    motion = driver.core._motion
    driver.world.wait_for(lambda: True if motion.load.state is then else None, f"load {then.value}", STROKE, 0.1)
    driver.world.advance(0.5)


def _judge(
    job: Job,
    driver: JoinedChassis,
    rack: str,
    goal: PointOfInterest | None,
    free: Sequence[PointOfInterest],
    area: Zone,
) -> None:
    """By the truth: the rack is at its point, or at a point of the area that was free; the chassis is not under it."""
    true, chassis = driver.world.true_pose(rack), driver.world.true_pose(driver.name)
    ends = [goal] if goal is not None else [point for point in free if area.contains(point.x, point.y)]
    end = min(ends, key=lambda point: math.hypot(point.x - true.x, point.y - true.y))
    job.away = math.hypot(end.x - true.x, end.y - true.y)
    job.turned = math.degrees(turn(true.yaw, end.yaw or 0.0))
    if math.hypot(chassis.x - true.x, chassis.y - true.y) < 0.8:
        raise _Failed("the chassis is still under the rack")
    if job.away > 0.03 or job.turned > 1.0:
        raise _Failed(f"the rack is {1e3 * job.away:.0f} mm and {job.turned:.2f}° off {end.name}")


# -- the world ---------------------------------------------------------------------------------------------------------


def _without_distractions(world: World) -> World:
    return world.model_copy(update={"arms": {}, "movers": {}, "timestep": 0.002})


def _only(world: World, kind: str, area: str) -> World:
    """In that area racks of that kind only, so that the first one found is of it."""
    middle = 10.5  # x of the wall between the areas
    here = {name for name, rack in world.racks.items() if (rack.pose[0] < middle) == (area == "storage")}
    racks = {name: rack for name, rack in world.racks.items() if rack.kind == kind or name not in here}
    known = {*racks, *world.statics, None}
    items = {name: item for name, item in world.items.items() if item.lies_on in known}
    return world.model_copy(update={"racks": racks, "items": items})


def _overlays(driver: JoinedChassis) -> MapOverlays:
    costmap = driver.core._motion.perception.costmap
    assert costmap is not None
    return costmap.static.overlays


def _area(overlays: MapOverlays, name: str) -> Zone:
    return next(zone for zone in overlays.zones if zone.name == name)


def _racks_at_points(driver: JoinedChassis, overlays: MapOverlays) -> dict[str, str]:
    """Id of a rack point → name of the rack there."""
    racks = driver.world.session.simulation.world.racks
    found = {}
    for name, rack in racks.items():
        point = overlays.nearest_point(PointType.RACK, rack.pose[0], rack.pose[1], AT_POINT)
        if point is not None:
            found[point.id] = name
    return found


def _nearest_rack(driver: JoinedChassis) -> str:
    poses, chassis = driver.world.true_poses(), driver.world.true_pose(driver.name)
    racks = driver.world.session.simulation.world.racks
    return min(racks, key=lambda name: math.hypot(poses[name].x - chassis.x, poses[name].y - chassis.y))


def forbidden(touches: Iterable[Touch], world: World) -> list[str]:
    """Pairs of parts that touched and must not."""
    found = []
    for touch in touches:
        a, b = sorted((_part(touch.parts[0], world), _part(touch.parts[1], world)))
        if (a, b) not in {("jack", "rack"), ("floor", "wheels"), ("floor", "rack"), ("item", "rack"), ("item", "item"),
                          ("item", "static")}:  # fmt: skip
            found.append(f"{touch.parts[0]}–{touch.parts[1]}")
    return found


def _part(name: str, world: World) -> str:
    if name in world.racks:
        return "rack"
    if name in world.items:
        return "item"
    return "static" if name in world.statics else name.rpartition("/")[2]
