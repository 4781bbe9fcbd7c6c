"""Drives a short imaginary move so that every compiled function exists before a real one begins.

``python -m rackhand.services.planner.warm_up`` is a part of ``rackhand prepare``.
"""

from __future__ import annotations

import io
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from PIL import Image

from rackhand.runtime.preparation import prepare
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import LocalisedPose, Odometry, Scan
from rackhand.schemas.maps import MapData
from rackhand.schemas.moves import MoveCreate
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.behaviors.base import Drive
from rackhand.services.planner.control.dynamic_avoidance import least_gap
from rackhand.services.planner.control.mppi import CostField, Mppi
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.perception.chassis_state import ChassisState
from rackhand.services.planner.perception.rack_legs import find_rack, leg_middles
from rackhand.services.planner.planning.corridor import Corridor
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.given_route import legs_of, parse_route
from rackhand.services.planner.planning.plan import GlobalPlanner, Target
from rackhand.services.planner.settings import NavigationSettings

TICK = 40_000_000
BODY = np.array([(0.4, 0.2), (-0.4, 0.2), (-0.4, -0.2), (0.4, -0.2)])


def warm_up(settings: NavigationSettings) -> None:
    """With a ``Motion`` of its own: the real one keeps its map and state."""
    with ThreadPoolExecutor(1) as executor:
        motion = Motion(settings, executor)
        motion.set_body(Footprint.of(BODY))
        motion.plans.lockstep = True
        _drive(motion, _room(), MoveCreate(target_x=4.0, target_y=2.0, target_ori=1.0), 0)
        # A corridor in which the body cannot turn: the search with the footprint.
        _drive(motion, _room(corridor=True), MoveCreate(target_x=4.0, target_y=2.5, target_ori=0.0), 4 * TICK)
    _give_way(settings)
    _leave_a_line(settings)
    _look_for_a_rack()


def _drive(motion: Motion, data: MapData, request: MoveCreate, stamp: int) -> None:
    motion.set_map(data)
    motion.begin(request)
    limits = motion.settings.control
    for k in range(4):
        state = _measured(stamp + k * TICK)
        motion.perceive(state)
        outcome = motion.step(state)
        motion.command(outcome if isinstance(outcome, Drive) else None, state, limits)
    motion.end()
    motion.brake(stamp + 4 * TICK)


def _give_way(settings: NavigationSettings) -> None:
    """Somebody comes towards the chassis: what real moves meet only when somebody does."""
    static = load_map(_room(), settings.slow_zone_velocity)
    room = DistanceGrid.of(static.blocked, static.geometry)
    footprint = Footprint.of(BODY)
    here, goal = np.array([1.0, 2.5, 0.0]), np.array([4.0, 2.5, 0.0])
    movers = np.array([(3.0, 2.5, -1.0, 0.0, 0.25)])
    plan = GlobalPlanner(static.geometry, footprint, settings).plan(here, Target(4.0, 2.5, 0.0), static.blocked)
    room.turn_clearance(footprint, here, 1.0)
    least_gap(here, plan.segments[0].points, 0.5, movers, footprint.edges, settings.yield_horizon)
    Mppi(settings).command(
        here, STANDSTILL, STANDSTILL, room, CostField(plan.cost, plan.geometry), goal, movers, footprint,
        settings.control.max_forward_velocity,
    )  # fmt: skip


def _leave_a_line(settings: NavigationSettings) -> None:
    """What only a route with a tolerance needs, when something is on it."""
    static, footprint = load_map(_room(), settings.slow_zone_velocity), Footprint.of(BODY)
    room = DistanceGrid.of(static.blocked, static.geometry)
    rows = legs_of(parse_route("1, 2.5, 4, 2.5"))[0].rows
    Corridor(rows[:, :2], 0.5).narrowed(room, footprint.inscribed)


def _look_for_a_rack() -> None:
    spec = RackSpec(width=0.8, depth=0.8)
    legs = leg_middles(spec) + np.array([1.5, 0.0])
    points = np.repeat(legs, 3, axis=0) + np.tile([(0.0, -0.01), (0.0, 0.0), (0.0, 0.01)], (4, 1))
    find_rack(points, np.zeros(3), np.array([1.5, 0.0, 0.0]), (spec,))


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


def _measured(stamp: int) -> ChassisState:
    state, pose = ChassisState(), Pose2(x=1.0, y=2.47, yaw=0.0)
    ranges = np.full(360, 9.0, dtype="<f4")
    ranges[:5] = 0.6  # something behind
    state.take(
        Scan(
            stamp=stamp,
            sensor=Pose2(x=0.0, y=0.0, yaw=0.0),
            angle_min=-math.pi,
            angle_step=math.pi / 180,
            range_max=10.0,
            ranges=ranges,
        )
    )
    state.take(LocalisedPose(stamp=stamp, pose=pose, covariance=np.eye(3), quality=8))
    state.take(Odometry(stamp=stamp, pose=pose, twist=STANDSTILL, wheel_velocities=(0.0, 0.0)))
    return state


if __name__ == "__main__":
    prepare(lambda: warm_up(NavigationSettings()))
