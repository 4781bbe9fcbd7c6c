"""CPU time of the planner's tick while it drives and replans, in halls of 15 to 500 m."""

from __future__ import annotations

import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from benchmarks.report import Report, percentile
from rackhand.runtime.memory import freeze_gc
from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.chassis import LocalisedPose, Odometry
from rackhand.schemas.maps import CreateMap
from rackhand.schemas.moves import CreateMove, MoveCreate, MoveRequest
from rackhand.schemas.world import Clock
from rackhand.services.planner.chassis import Chassis
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.settings import NavigationSettings
from rackhand.services.planner.store import PlannerStore
from rackhand.services.planner.warm_up import warm_up
from tests.chassis_models import chassis_model
from tests.planner.plant import BODY, Hall, Plant, box

SIZES = (15, 20, 50, 100, 200, 500)  # m, of a side
TICKS = 450  # 18 s of driving in each hall
NEW_GOAL = 150  # ticks between replaced moves
PILLARS, PILLARED = 5.0, 60.0  # m between pillars on the map, and from the start up to which they stand
PERIOD = 0.04  # s
CRATES = 2.5  # m ahead of the chassis at which unmapped crates appear, one a goal: they block the route


def run() -> Report:
    settings = NavigationSettings()
    warm_up(settings)
    rows = []
    for size in SIZES:
        ticks, plans = drive(size, settings)
        milliseconds = [tick * 1e3 for tick in ticks]
        rows.append(
            (
                f"{size} m",
                f"{percentile(milliseconds, 0.5):.1f}",
                f"{percentile(milliseconds, 0.99):.1f}",
                f"{max(milliseconds):.1f}",
                str(plans),
            )
        )
    return Report(
        "CPU time of a planner tick",
        "python -m benchmarks planner_tick",
        ("hall", "median ms", "p99 ms", "worst ms", "paths taken"),
        rows,
        f"CPU time of the tick's thread, {TICKS} ticks a hall, cells of 5 cm, 720 beams at 12.5 Hz, pillars every "
        f"{PILLARS:.0f} m in the {PILLARED:.0f} m about the start, a new goal every {NEW_GOAL} ticks and an unmapped "
        "crate on the route. Plans are made in the worker's thread meanwhile; the budget of a tick is 8 ms.",
    )


def drive(size: float, settings: NavigationSettings) -> tuple[list[float], int]:
    """CPU seconds of each tick, and how many paths the behaviours took."""
    plant = Plant(hall(size), (1.5, 1.5, 0.8), seed=1)
    seconds: list[float] = []
    taken: set[tuple[int, int]] = set()
    with (
        tempfile.TemporaryDirectory() as folder,
        PlannerStore(Path(folder) / "store.sqlite", "bench") as store,
        ThreadPoolExecutor(1) as executor,
    ):
        data = plant.hall.map()
        store.maps.use(
            store.maps.create(
                CreateMap(map_name="hall", png=data.png, origin=data.origin, resolution=data.resolution), 0
            )
        )
        motion = Motion(settings, executor)
        chassis = Chassis(motion, store.moves, store.maps, store.parameters)
        chassis.on_message(chassis_model(BODY))
        chassis.set_driver_fault("")
        freeze_gc()  # as the service does when it is ready
        for tick in range(TICKS):
            begun_at = time.monotonic()
            if tick % NEW_GOAL == 0:
                plant.crates = []
                measure(chassis, plant)
                new_goal(chassis, size, tick // NEW_GOAL)
            if tick % NEW_GOAL == NEW_GOAL // 3:
                ahead = plant.pose[:2] + CRATES * np.array([np.cos(plant.pose[2]), np.sin(plant.pose[2])])
                plant.crates = [box(*ahead, 0.5, 0.5)]
            measure(chassis, plant)
            begun = time.thread_time()
            command = chassis.tick(lockstep=False)
            chassis.take_publications()
            seconds.append(time.thread_time() - begun)
            plant.drive(command.twist)
            if motion.move is not None:
                taken.add((tick // NEW_GOAL, motion.move.status().plans))
            time.sleep(
                max(0.0, begun_at + PERIOD - time.monotonic())
            )  # so that the worker has the time it has on a robot
    return seconds, len({plan for plan in taken if plan[1] > 0})


def hall(size: float) -> Hall:
    """A square hall with pillars on the map."""
    places = np.arange(PILLARS, min(size - 1.0, PILLARED), PILLARS)
    return Hall(size, size, [box(x, y, 0.5, 0.5) for x in places for y in places])


def new_goal(chassis: Chassis, size: float, number: int) -> None:
    """Post a move to a corner, another one each time."""
    x, y = [(size - 1.5, size - 1.5), (size - 1.5, 1.5), (1.5, size - 1.5)][number % 3]
    move = MoveCreate(type="standard", target_x=x, target_y=y, target_ori=0.0)
    chassis.moves(MoveRequest(request=CreateMove(move=move)))


def measure(chassis: Chassis, plant: Plant) -> None:
    """All that driver and localiser publish of this instant."""
    seen = plant.observe()
    chassis.on_message(LocalisedPose(stamp=seen.pose_stamp, pose=seen.pose, covariance=np.eye(3) * 1e-4, quality=8))
    if seen.scan is not None:
        chassis.on_message(seen.scan)
    chassis.on_message(Odometry(stamp=seen.stamp, pose=seen.odometry, twist=seen.twist, wheel_velocities=(0.0, 0.0)))
    chassis.on_clock(
        Clock(
            stamp=seen.stamp, run="bench", step_ns=2_000_000, speed=1.0, paused=False, lockstep=False,
            unix_ns=1_700_000_000 * NANOSECONDS,
        )
    )  # fmt: skip
