"""Drives a short imaginary move so that every compiled function exists before a real one begins."""

from __future__ import annotations

import io
import math
from collections.abc import Callable

import numpy as np
from PIL import Image

from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import Scan
from rackhand.schemas.maps import MapData
from rackhand.services.planner.behaviors.interface import Navigator
from rackhand.services.planner.control.dynamic_avoidance import least_gap
from rackhand.services.planner.control.mppi import CostField, Mppi
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.perception.chassis_state import Observation
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.planning.plan import GlobalPlanner, Target
from rackhand.services.planner.settings import NavigationSettings

TICK = 40_000_000


def warm_up(settings: NavigationSettings, make: Callable[[NavigationSettings], Navigator]) -> None:
    """Makes a navigator of its own for it; the one that is being warmed keeps its map and state."""
    navigator = make(settings)
    navigator.set_map(_room())
    navigator.start(Goal(4.0, 2.0, 1.0), _seen(0))
    for k in range(3):
        navigator.tick(_seen(k * TICK))
    navigator.stop()
    # A corridor in which the body cannot turn: the search with the footprint.
    navigator.set_map(_room(corridor=True))
    navigator.observe(_seen(3 * TICK))
    navigator.start(Goal(4.0, 2.5, 0.0), _seen(3 * TICK))
    navigator.tick(_seen(3 * TICK))
    navigator.brake(_seen(4 * TICK))
    _give_way(settings)


def _give_way(settings: NavigationSettings) -> None:
    """Somebody comes towards the chassis: what real moves meet only when somebody does."""
    static = load_map(_room(), settings.slow_zone_velocity)
    room = DistanceGrid.of(static.blocked, static.geometry)
    footprint = Footprint.of(np.array([(0.4, 0.2), (-0.4, 0.2), (-0.4, -0.2), (0.4, -0.2)]))
    here, goal = np.array([1.0, 2.5, 0.0]), np.array([4.0, 2.5, 0.0])
    movers = np.array([(3.0, 2.5, -1.0, 0.0, 0.25)])
    plan = GlobalPlanner(static.geometry, footprint, settings).plan(here, Target(4.0, 2.5, 0.0), static.blocked)
    room.turn_clearance(footprint, here, 1.0)
    least_gap(here, plan.segments[0].points, 0.5, movers, footprint.edges, settings.yield_horizon)
    Mppi(settings).command(
        here, STANDSTILL, STANDSTILL, room, CostField(plan.cost, static.geometry), goal, movers, footprint,
        settings.control.max_forward_velocity,
    )  # fmt: skip


def _room(corridor: bool = False) -> MapData:
    grey = np.full((100, 120), 254, dtype=np.uint8)
    grey[[0, -1]] = grey[:, [0, -1]] = 0
    if corridor:
        grey[:44] = grey[57:] = 0
    stream = io.BytesIO()
    Image.fromarray(grey).save(stream, "PNG")
    return MapData(
        id=-1, uid="warm-up", map_name="warm-up", create_time=0, last_modified_time=0, png=stream.getvalue(),
        origin=(0.0, 0.0), resolution=0.05,
    )  # fmt: skip


def _seen(stamp: int) -> Observation:
    pose = Pose2(x=1.0, y=2.47, yaw=0.0)
    ranges = np.full(360, 9.0, dtype="<f4")
    ranges[:5] = 0.6  # something behind
    scan = Scan(
        stamp=stamp,
        sensor=Pose2(x=0.0, y=0.0, yaw=0.0),
        angle_min=-math.pi,
        angle_step=math.pi / 180,
        range_max=10.0,
        ranges=ranges,
    )
    return Observation(stamp, pose, stamp, pose, Twist2(linear=0.0, angular=0.0), scan)
