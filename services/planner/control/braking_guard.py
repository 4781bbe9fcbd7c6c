"""The last check of every command, whatever its source: can the chassis (its exact footprint) still stop after it?"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.schemas.base import NANOSECONDS, Twist2
from rackhand.services.planner.control import speed_profile as profile
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import distance_to_body
from rackhand.services.planner.geometry.polygon import inside_convex
from rackhand.services.planner.geometry.se2 import STANDSTILL, Pose
from rackhand.services.planner.map.grid import Mask
from rackhand.services.planner.settings import Limits, NavigationSettings

Array = NDArray[np.float64]
PERIOD = 0.04  # s; the nominal tick
AT_REST = 0.01  # m/s and rad/s: a braking command below it is standstill
LONGEST = 0.1  # s; a late tick does not allow for more acceleration than this
SHARES = (1.0, 0.5, 0.2)  # of the wanted twist that are tried before braking
STEP = 0.04  # s
WORSE = 1e-6  # m; a trajectory is to blame only if it comes nearer than standing still would
# Where something comes at the chassis anyway, getting away must not be vetoed because a corner swings out first.
WORSE_MOVING = 0.15
TURN_REACH = 0.5  # m that turning alone can bring a corner nearer to something beside
TURNING_STOP = 1.0  # s that stopping a turn can take
LOOK_ON = 0.3  # s after standstill for things that move


@dataclass(frozen=True)
class Surroundings:
    """What a command is checked against, in one frame: the map's, or odometry's without a map pose.

    ``obstacles``: rows x, y, vx, vy, margin, in metres and m/s.
    """

    pose: Pose
    obstacles: Array


class Stop(NamedTuple):
    """How the chassis comes to rest: ``hold`` s until braking takes effect, ``lag`` s behind its commands, and its
    decelerations in m/s² and rad/s²."""

    hold: float
    lag: float
    decel: float
    turn_decel: float


class BrakingGuard:
    """Holds the last command; ``drive`` or ``brake`` makes the next one, once a tick.

    ``vetoed``: the last wanted twist did not pass as it was.
    """

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """The driver restarted: it starts from standstill."""
        self.command, self.vetoed = STANDSTILL, False
        self._acceleration = 0.0
        self._stamp: int | None = None

    def drive(
        self,
        wanted: Twist2,
        view: Surroundings | None,
        measured: Twist2,
        stamp: int,
        limits: Limits,
        edges: Array,
        settings: NavigationSettings,
        may_touch: tuple[Array, ...] = (),
    ) -> Twist2:
        """The wanted twist within ``limits``, if the chassis could still stop after it; else slower, else braking.

        ``view``: what surrounds it; None brakes. ``edges``: of the footprint. Obstacles inside the convex polygons of
        ``may_touch`` (map frame) are ignored.
        """
        dt = self._since(stamp)
        if view is not None:
            obstacles = view.obstacles
            for polygon in may_touch:
                obstacles = obstacles[~inside_convex(polygon, obstacles[:, :2])]
            linear = min(max(wanted.linear, limits.max_backward_velocity), limits.max_forward_velocity)
            angular = min(max(wanted.angular, -limits.max_angular_velocity), limits.max_angular_velocity)
            for share in SHARES:
                command = profile.smoothed(
                    self.command, share * linear, share * angular, dt, limits, self._acceleration, settings.build_up
                )
                if braking_is_free(view.pose, measured, command, PERIOD, obstacles, edges, settings):
                    return self._next(command, stamp, vetoed=share < 1.0)
        return self._brake(profile.braked(self.command, dt, settings.own), stamp, vetoed=True)

    def brake(self, stamp: int, limits: Limits) -> Twist2:
        """The next command of the shortest stop."""
        command = profile.braked(self.command, self._since(stamp), limits)
        at_rest = max(abs(command.linear), abs(command.angular)) < AT_REST
        return self._brake(STANDSTILL if at_rest else command, stamp, vetoed=False)

    def _since(self, stamp: int) -> float:
        if self._stamp is None or stamp <= self._stamp:
            return PERIOD
        return min((stamp - self._stamp) / NANOSECONDS, LONGEST)

    def _brake(self, command: Twist2, stamp: int, vetoed: bool) -> Twist2:
        """The shortest stop knows no jerk: it neither builds up nor ends slowly."""
        self._next(command, stamp, vetoed)
        self._acceleration = 0.0
        return command

    def _next(self, command: Twist2, stamp: int, vetoed: bool) -> Twist2:
        self._acceleration = (command.linear - self.command.linear) / self._since(stamp)
        self.command, self.vetoed, self._stamp = command, vetoed, stamp
        return command


def braking_is_free(
    pose: Pose,
    measured: Twist2,
    command: Twist2,
    hold: float,
    obstacles: Array,
    body_edges: Array,
    settings: NavigationSettings,
) -> bool:
    """Whether braking after ``hold`` seconds of this command hits nothing.

    ``obstacles``: rows x, y (map frame), vx, vy (m/s), margin (m). Something is hit when it comes nearer to the body
    than its margin and nearer than it would if the chassis stood still, so leaving a tight place is not forbidden.
    """
    a, own = settings.actuation, settings.own
    stop = Stop(hold + a.latency, a.lag, -own.max_forward_decel, own.max_angular_acc)
    return bool(
        _braking_is_free(
            pose, measured.linear, measured.angular, command.linear, command.angular, stop, obstacles, body_edges
        )
    )


@compiled
def _within_reach(start: Pose, speed: float, stop: Stop, obstacles: Array, body_edges: Array) -> Array:
    """The obstacles that can matter: nearer than the stop is long and than they come in that time."""
    before = stop.hold + 4.0 * stop.lag  # braking has taken hold
    duration = before + speed / stop.decel + TURNING_STOP + LOOK_ON
    reach = TURN_REACH + speed * before + speed * speed / (2.0 * stop.decel)
    kept = np.empty_like(obstacles)
    n = 0
    for k in range(obstacles.shape[0]):
        coming = math.hypot(obstacles[k, 2], obstacles[k, 3]) * duration + obstacles[k, 4]
        if distance_to_body(body_edges, start, obstacles[k, 0], obstacles[k, 1]) < reach + coming:
            kept[n] = obstacles[k]
            n += 1
    return kept[:n]


@compiled
def _braking_is_free(
    start: Pose, v: float, w: float, v_command: float, w_command: float, stop: Stop, obstacles: Array, body_edges: Array
) -> bool:
    obstacles = _within_reach(start, max(abs(v), abs(v_command)), stop, obstacles, body_edges)
    decel, turn_decel, lag = stop.decel, stop.turn_decel, stop.lag
    pose = start.copy()
    time = 0.0
    still = 0.0
    while still < LOOK_ON:
        if time >= stop.hold:
            before = v_command
            v_command = math.copysign(max(abs(v_command) - decel * STEP, 0.0), v_command)
            kept = w_command * (v_command / before) if abs(before) > 1e-9 else 0.0
            w_command += min(max(kept - w_command, -turn_decel * STEP), turn_decel * STEP)
        v += (v_command - v) * min(1.0, STEP / lag)
        w += (w_command - w) * min(1.0, STEP / lag)
        pose[0] += v * math.cos(pose[2] + 0.5 * w * STEP) * STEP
        pose[1] += v * math.sin(pose[2] + 0.5 * w * STEP) * STEP
        pose[2] += w * STEP
        time += STEP
        if abs(v) < 0.01 and abs(w) < 0.02 and time >= stop.hold:
            still += STEP
        for k in range(obstacles.shape[0]):
            x = obstacles[k, 0] + obstacles[k, 2] * time
            y = obstacles[k, 1] + obstacles[k, 3] * time
            away = distance_to_body(body_edges, pose, x, y)
            if away >= obstacles[k, 4]:
                continue
            worse = WORSE if obstacles[k, 2] == 0.0 and obstacles[k, 3] == 0.0 else WORSE_MOVING
            if away < distance_to_body(body_edges, start, x, y) - worse:
                return False
    return True


def nearby_cells(blocked: Mask, geometry: Geometry, window: tuple[slice, slice]) -> Array:
    """Centres of blocked cells in a window, rows x, y."""
    rows, columns = np.nonzero(blocked)
    return np.column_stack(
        [
            geometry.x + (columns + (window[1].start or 0) + 0.5) * geometry.resolution,
            geometry.y + (rows + (window[0].start or 0) + 0.5) * geometry.resolution,
        ]
    )


def as_obstacles(points: Array, margin: float) -> Array:
    """Points at rest as rows for the check."""
    rows = np.zeros((len(points), 5))
    rows[:, :2] = points
    rows[:, 4] = margin
    return rows
