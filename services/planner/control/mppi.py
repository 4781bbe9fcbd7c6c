"""Model predictive path integral control: avoids dynamic obstacles on the path to the goal (Williams et al. 2017).

The rollout knows the limits on acceleration, the dead time and the lag of the drive; without them MPPI drives into
obstacles. Noise is drawn once from a fixed seed and used in turn, so the same inputs give the same commands.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled, inlined
from rackhand.schemas.base import Twist2
from rackhand.services.planner.control.mppi_costs import (
    backward_cost,
    collision_weight,
    dynamic_cost,
    effort_cost,
    goal_cost,
    heading_cost,
    static_cost,
)
from rackhand.services.planner.control.speed_profile import ramp
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint, edge_distance
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.field import Field, cell_value
from rackhand.services.planner.settings import Limits, MppiCosts, NavigationSettings

Array = NDArray[np.float64]

SEED = 20
PERIOD = 0.04  # s between two commands
BODY_DISCS = 3
# Samples 0 and 1 are the last solution and a stop, then come the primitives: POLICIES of them for each bearing.
FIRST_PRIMITIVE, POLICIES, BEARINGS = 2, 4, 24
BACKWARD_POLICY = 3  # drives backward all the time
DRIVING_TIME = 1.2  # s that policy 0 drives; policy 1 twice as long, the others all the time
TURN_GAIN = 2.5  # 1/s, of the primitives


class CostField(NamedTuple):
    """Cost to go of each cell (rows, columns) in metres, infinite or absent where there is no path."""

    cost: Field
    geometry: Geometry


class Drive(NamedTuple):
    """How the chassis follows commands. ``step`` and ``lag`` in seconds, ``lateral``: acceleration in bends, m/s²."""

    step: float
    lag: float
    limits: Limits
    lateral: float


class MppiProblem(NamedTuple):
    """What a rollout is driven and judged by.

    ``near``: clearances around the chassis. ``obstacles``: rows x, y, vx, vy, radius of dynamic obstacles. ``edges``
    and ``discs``: the body exactly, and as rows x, r of discs on its long axis.
    """

    drive: Drive
    near: DistanceGrid
    field: CostField
    goal: Pose
    obstacles: Array
    edges: Array
    discs: Array
    costs: MppiCosts


class BodyFrame(NamedTuple):
    """Where the body is in the map: its origin in metres, cosine and sine of its yaw."""

    x: float
    y: float
    cos: float
    sin: float


class Mppi:
    """Keeps the last solution to start the next from."""

    def __init__(self, settings: NavigationSettings) -> None:
        m = settings.mppi
        self._settings = settings
        # Whole numbers among the settings would make compiled code of their own.
        self._costs = MppiCosts(*(float(cost) for cost in m.costs))
        self.set_limits(settings.control)
        random = np.random.default_rng(SEED)
        white = random.standard_normal((m.banks, m.samples, m.steps, 2))
        for t in range(1, m.steps):
            fresh = math.sqrt(1 - m.noise_correlation**2) * white[:, :, t]
            white[:, :, t] = m.noise_correlation * white[:, :, t - 1] + fresh
        self._noise = white * (m.noise_linear, m.noise_angular)
        self.restart()

    def set_limits(self, limits: Limits) -> None:
        """What may be commanded from now on."""
        self._limits = Limits(*(float(limit) for limit in limits))

    def restart(self) -> None:
        """Forget the last solution; a run from here depends on nothing before."""
        self._turn = 0
        self._plan = np.zeros((self._settings.mppi.steps, 2))

    def command(
        self,
        pose: Pose,
        measured: Twist2,
        last: Twist2,
        near: DistanceGrid,
        field: CostField,
        goal: Pose,
        obstacles: Array,
        footprint: Footprint,
        speed_limit: float,
    ) -> Twist2:
        """The twist to command. ``pose``: where the command takes effect. ``last``: the command before.

        ``goal``: x, y, yaw for the last metres. ``obstacles``: rows x, y, vx, vy, radius. ``speed_limit`` in m/s.
        """
        m = self._settings.mppi
        noise = self._noise[self._turn % m.banks]
        self._turn += 1
        limits = self._limits._replace(max_forward_velocity=min(self._limits.max_forward_velocity, float(speed_limit)))
        s = self._settings
        drive = Drive(float(m.step), float(s.actuation.lag), limits, float(s.max_lateral_acc))
        problem = MppiProblem(drive, near, field, goal, obstacles, footprint.edges, body_discs(footprint), self._costs)
        start = np.array([*pose, measured.linear, measured.angular, last.linear, last.angular])
        costs, commands = rollouts(problem, self._plan, noise, start)
        weights = np.exp(-(costs - costs.min()) / m.temperature)
        weights /= weights.sum()
        solution = np.tensordot(weights, commands, axes=1)
        # The time to the next tick is less than a step, so the solution moves on by that share of it.
        share = PERIOD / m.step
        self._plan[:-1] = (1 - share) * solution[:-1] + share * solution[1:]
        self._plan[-1] = solution[-1]
        # A mean of commands that keep the limit may be beyond it.
        linear, angular = slower_in_bends(float(solution[0, 0]), float(solution[0, 1]), drive.lateral)
        return Twist2(linear=linear, angular=angular)


def body_discs(footprint: Footprint) -> Array:
    """Rows x, r: discs on the long axis that cover the body, for quick checks against cells."""
    low, high = footprint.polygon[:, 0].min(), footprint.polygon[:, 0].max()
    half_width = float(np.abs(footprint.polygon[:, 1]).max())
    share = (high - low) / BODY_DISCS
    x = low + share * (np.arange(BODY_DISCS) + 0.5)
    return np.column_stack([x, np.full(BODY_DISCS, math.hypot(half_width, 0.5 * share))])


@compiled
def rollouts(problem: MppiProblem, plan: Array, noise: Array, start: Array) -> tuple[Array, Array]:
    """Cost of each sample (k,), and the commands v, w it really consists of after the limits, (k, t, 2).

    ``start``: x, y, yaw, measured v, w, commanded v, w. Sample 0 is the last solution ``plan`` (t, 2), 1 stops, the
    next are primitives (noise about a standstill would not find these); the rest is the last solution with noise
    (k, t, 2).
    """
    samples, steps = noise.shape[0], noise.shape[1]
    dt, limits = problem.drive.step, problem.drive.limits
    follow = 1.0 - math.exp(-dt / problem.drive.lag)
    near, obstacles, edges, discs = problem.near, problem.obstacles, problem.edges, problem.discs
    costs = np.zeros(samples)
    commands = np.empty((samples, steps, 2))
    for k in range(samples):
        x, y, yaw, v, w, cv, cw = start
        total = 0.0
        for t in range(steps):
            if k == 0:
                wanted_v, wanted_w = plan[t, 0], plan[t, 1]
            elif k == 1:
                wanted_v, wanted_w = 0.0, 0.0
            elif k < FIRST_PRIMITIVE + POLICIES * BEARINGS:
                wanted_v, wanted_w = primitive(k - FIRST_PRIMITIVE, (t + 1) * dt, yaw, limits)
            else:
                wanted_v, wanted_w = plan[t, 0] + noise[k, t, 0], plan[t, 1] + noise[k, t, 1]
            cv, cw = limited(cv, cw, wanted_v, wanted_w, problem.drive)
            commands[k, t, 0] = cv
            commands[k, t, 1] = cw
            v += (cv - v) * follow
            w += (cw - w) * follow
            middle = yaw + 0.5 * w * dt
            x += v * math.cos(middle) * dt
            y += v * math.sin(middle) * dt
            yaw += w * dt
            body = BodyFrame(x, y, math.cos(yaw), math.sin(yaw))
            weight = collision_weight(t, steps, problem.costs)
            total += static_cost(disc_clearance(near, discs, body), dt, weight, problem.costs)
            for m in range(obstacles.shape[0]):
                away = obstacle_clearance(obstacles, m, (t + 1) * dt, edges, body, problem.costs)
                total += dynamic_cost(away, dt, weight, problem.costs)
            total += effort_cost(v, w, dt, problem.costs) + backward_cost(v, dt, problem.costs)
        costs[k] = total + terminal_cost(problem, x, y, yaw)
    return costs, commands


@inlined
def primitive(index: int, time: float, yaw: float, limits: Limits) -> tuple[float, float]:
    """Speed and turning rate wanted by a primitive: turn to its bearing and drive there for 1.2 s, 2.4 s, or all the
    time, or go there backward."""
    policy, bearing = index // BEARINGS, (index + FIRST_PRIMITIVE) * 2.0 * math.pi / BEARINGS
    error = wrap(bearing - yaw)
    speed = limits.max_backward_velocity if policy == BACKWARD_POLICY else limits.max_forward_velocity
    if policy < 2 and time > (1.0 + policy) * DRIVING_TIME:
        speed = 0.0
    return speed * max(math.cos(error), 0.0) ** 2, TURN_GAIN * error


@inlined
def limited(v: float, w: float, wanted_v: float, wanted_w: float, drive: Drive) -> tuple[float, float]:
    """The command after ``v``, ``w`` a step later, within the limits on velocity and acceleration.

    A lateral acceleration beyond ``drive.lateral`` grows no more.
    """
    limits, dt = drive.limits, drive.step
    wanted_v = min(max(wanted_v, limits.max_backward_velocity), limits.max_forward_velocity)
    wanted_w = min(max(wanted_w, -limits.max_angular_velocity), limits.max_angular_velocity)
    wanted_v, wanted_w = slower_in_bends(wanted_v, wanted_w, drive.lateral)
    turn = limits.max_angular_acc * dt
    angular = w + max(-turn, min(turn, wanted_w - w))
    fastest = drive.lateral / max(abs(angular), 1e-6)
    wanted_v = min(max(wanted_v, -fastest), fastest)
    linear = ramp(v, wanted_v, limits.max_forward_acc * dt, -limits.max_forward_decel * dt)
    if abs(linear * angular) > drive.lateral:  # it cannot brake so soon: turn in more slowly
        most = max(drive.lateral / abs(linear), abs(w) - turn)
        angular = min(max(angular, -most), most)
    return linear, angular


@inlined
def slower_in_bends(v: float, w: float, lateral: float) -> tuple[float, float]:
    """That command on the same arc, at most as fast as gives the acceleration ``lateral`` (m/s²) to the side."""
    share = abs(v * w) / lateral
    if share <= 1.0:
        return v, w
    return v / math.sqrt(share), w / math.sqrt(share)


@inlined
def disc_clearance(near: DistanceGrid, discs: Array, body: BodyFrame) -> float:
    """Metres from the discs (rows x, r) of a body to the nearest blocked cell's edge, to a cell's accuracy; outside the
    grid everything is blocked."""
    free = 1e9
    for d in range(discs.shape[0]):
        px, py = body.x + body.cos * discs[d, 0], body.y + body.sin * discs[d, 0]
        free = min(free, cell_value(near.distance, near.geometry, px, py, 0.0) - discs[d, 1])
    return free - 0.5 * near.geometry.resolution


@inlined
def obstacle_clearance(obstacles: Array, m: int, time: float, edges: Array, body: BodyFrame, costs: MppiCosts) -> float:
    """Metres from the body to where obstacle ``m`` (row x, y, vx, vy, radius) is after ``time`` seconds; infinite where
    it is out of range."""
    dx = obstacles[m, 0] + obstacles[m, 2] * time - body.x
    dy = obstacles[m, 1] + obstacles[m, 3] * time - body.y
    if abs(dx) > costs.dynamic_range or abs(dy) > costs.dynamic_range:
        return np.inf
    away = edge_distance(edges, body.cos * dx + body.sin * dy, -body.sin * dx + body.cos * dy)
    return float(away - (obstacles[m, 4] + costs.dynamic_growth * time))


@inlined
def terminal_cost(problem: MppiProblem, x: float, y: float, yaw: float) -> float:
    """Cost of where a rollout ends: what is left to the goal, and the heading near it."""
    field, goal, costs = problem.field, problem.goal, problem.costs
    away = math.hypot(goal[0] - x, goal[1] - y)
    to_go = cell_value(field.cost, field.geometry, x, y, np.inf)
    return goal_cost(to_go, away, costs) + heading_cost(wrap(goal[2] - yaw), away, costs)
