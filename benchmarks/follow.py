"""How well the distance to a target is kept while it walks a figure-eight, in physics."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.progress import track
from benchmarks.report import Report, median
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import FollowTarget
from rackhand.schemas.world import MoveRobot, Place
from rackhand.services.planner.settings import NavigationSettings
from rackhand.worlds.world_model import load_world
from tests.joined.world import JoinedWorld

SECONDS = 120.0
SPEEDS = (0.4, 0.6)  # m/s of the target
SETTLED = 8.0  # s before the distance counts
CENTRE, HALF_LENGTH, HALF_WIDTH = (14.3, 5.5), 2.6, 2.0  # m
PERIOD = 0.32  # s between reports
WANTED = NavigationSettings().follow_distance


def run() -> Report:
    rows = [follow(speed) for speed in track(SPEEDS, "follow_target")]
    return Report(
        "Following a target",
        "python -m benchmarks follow",
        ("target m/s", "distance m: median", "least", "greatest", "off the wanted at most m", "contacts"),
        rows,
        f"A person walks a figure-eight of {2 * HALF_LENGTH:.1f} x {HALF_WIDTH:.1f} m for {SECONDS:.0f} s in world "
        f"`warehouse`, in physics; the client reports the true position every {PERIOD} s, the chassis is to keep "
        f"{WANTED} m. Distances are those of the true poses, after {SETTLED:.0f} s.",
    )


def follow(speed: float) -> tuple[str, ...]:
    loaded = load_world("warehouse").model_copy(update={"movers": {}})
    with tempfile.TemporaryDirectory() as folder, JoinedWorld(loaded, Path(folder), with_arms=False) as world:
        chassis, walk = world.chassis(), figure_eight()
        chassis.overlay()
        first, second = walk[0], walk[1]
        yaw = math.atan2(second.y - first.y, second.x - first.x)
        behind = Pose2(x=first.x - 1.4 * math.cos(yaw), y=first.y - 1.4 * math.sin(yaw), yaw=yaw)
        world.ask(MoveRobot(robot="amr1", pose=behind))
        world.advance(1.0)
        world.ask(Place(name="target", kind="person", pose=first, size=(0.25, 1.7), walk=walk, speed=speed))
        move = chassis.post(type="follow_target")
        distances = []
        for k in range(round(SECONDS / PERIOD)):
            target, pose = world.true_pose("target"), world.true_pose("amr1")
            if k * PERIOD > SETTLED:
                distances.append(math.hypot(target.x - pose.x, target.y - pose.y))
            chassis.ask(FollowTarget(state="follow_pose", position=(target.x, target.y)))
            world.advance(PERIOD)
        if (ended := chassis.move(move)).state != "moving":
            raise RuntimeError(f"follow_target: {ended.state}, {ended.fail_message}")
        off = max(abs(away - WANTED) for away in distances)
        figures = median(distances), min(distances), max(distances), off
        contacts = world.inspect().contact_count
        return f"{speed:.1f}", *(f"{one:.2f}" for one in figures), str(contacts)


def figure_eight() -> tuple[Pose2, ...]:
    """Waypoints of a lemniscate of Gerono."""
    t = np.linspace(0.0, 2.0 * math.pi, 96, endpoint=False)
    x, y = CENTRE[0] + HALF_LENGTH * np.sin(t), CENTRE[1] + HALF_WIDTH * np.sin(t) * np.cos(t)
    return tuple(Pose2(x=float(a), y=float(b), yaw=0.0) for a, b in zip(x, y, strict=True))
