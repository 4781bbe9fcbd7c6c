"""Model predictive path integral control: makes way for what moves on the way to the goal (Williams et al. 2017).

The rollout knows the limits on acceleration, the dead time and the lag of the drive; without them MPPI drives into
things. Noise is drawn once from a fixed seed and used in turn, so the same inputs give the same commands.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.schemas.base import Twist2
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.map.grid import Geometry
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.field import Field
from rackhand.services.planner.settings import NavigationSettings

Array = NDArray[np.float64]

SEED = 20
PERIOD = 0.04  # s between two commands
COLOUR = 0.85  # correlation of the noise from step to step
BODY_DISCS = 3
BEARINGS = 24
TURN_GAIN = 2.5  # 1/s
HIT = 400.0  # cost of a step in collision, less the later it is
NEAR_STATIC, STATIC_SCALE = 2.0, 0.08  # cost of a step that touches, falling by e each so many metres
NEAR_MOVER, MOVER_SCALE = 6.0, 0.35
MOVER_GROWTH = 0.04  # m/s by which a prediction gets wider
BACKWARD = 0.3  # cost of a metre driven backward
EFFORT = 0.02
OFF_FIELD = 60.0  # cost to go where there is no field, on top of the distance


class Mppi:
    """Keeps the last solution to start the next from."""

    def __init__(self, settings: NavigationSettings) -> None:
        m = settings.mppi
        self._settings = settings
        random = np.random.default_rng(SEED)
        white = random.standard_normal((m.banks, m.samples, m.steps, 2))
        for t in range(1, m.steps):
            white[:, :, t] = COLOUR * white[:, :, t - 1] + math.sqrt(1 - COLOUR**2) * white[:, :, t]
        self._noise = white * (m.noise_linear, m.noise_angular)
        self.restart()

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
        cost: Field,
        geometry: Geometry,
        goal: Pose,
        movers: Array,
        footprint: Footprint,
        speed_limit: float,
    ) -> Twist2:
        """The twist wanted now. ``pose``: where the command takes hold. ``movers``: rows x, y, vx, vy, radius.

        ``cost``: cost to go over ``geometry``; ``goal``: x, y, yaw for the last metres.
        """
        m, s = self._settings.mppi, self._settings
        noise = self._noise[self._turn % m.banks]
        self._turn += 1
        c, g = s.control, near.geometry
        limits = np.array(
            [
                c.max_backward_velocity,
                min(c.max_forward_velocity, speed_limit),
                c.max_angular_velocity,
                c.max_forward_acc,
                -c.max_forward_decel,
                c.max_angular_acc,
            ]
        )
        start = np.array([*pose, measured.linear, measured.angular, last.linear, last.angular])
        costs, commands = _rollouts(
            self._plan, noise, start, m.step, s.actuation.lag, limits, near.distance, g.x, g.y, g.resolution, cost,
            geometry.x, geometry.y, goal, movers, footprint.edges, body_discs(footprint),
        )  # fmt: skip
        weights = np.exp(-(costs - costs.min()) / m.temperature)
        weights /= weights.sum()
        solution = np.tensordot(weights, commands, axes=1)
        # The time to the next tick is less than a step, so the solution moves on by that share of it.
        share = PERIOD / m.step
        self._plan[:-1] = (1 - share) * solution[:-1] + share * solution[1:]
        self._plan[-1] = solution[-1]
        return Twist2(linear=float(solution[0, 0]), angular=float(solution[0, 1]))


def body_discs(footprint: Footprint) -> Array:
    """Rows x, r: discs on the long axis that cover the body, for quick checks against cells."""
    low, high = footprint.polygon[:, 0].min(), footprint.polygon[:, 0].max()
    half_width = float(np.abs(footprint.polygon[:, 1]).max())
    share = (high - low) / BODY_DISCS
    x = low + share * (np.arange(BODY_DISCS) + 0.5)
    return np.column_stack([x, np.full(BODY_DISCS, math.hypot(half_width, 0.5 * share))])


@compiled
def _towards(current: float, wanted: float, rise: float, fall: float) -> float:
    if current * wanted < 0.0:
        wanted = 0.0
    step = rise if abs(wanted) > abs(current) else fall
    return current + max(-step, min(step, wanted - current))


@compiled
def _cell(field: Field, x0: float, y0: float, resolution: float, x: float, y: float, outside: float) -> float:
    i = math.floor((y - y0) / resolution)
    j = math.floor((x - x0) / resolution)
    if i < 0 or j < 0 or i >= field.shape[0] or j >= field.shape[1]:
        return outside
    return float(field[i, j])


@compiled
def _rollouts(
    plan: Array,
    noise: Array,
    start: Array,
    dt: float,
    lag: float,
    limits: Array,
    distance: Field,
    near_x: float,
    near_y: float,
    resolution: float,
    cost: Field,
    map_x: float,
    map_y: float,
    goal: Pose,
    movers: Array,
    body_edges: Array,
    discs: Array,
) -> tuple[Array, Array]:
    """Cost of each sample, and the commands it really consists of after the limits, (k, t, 2).

    Sample 0 is the last solution, 1 stops, the next turn to all bearings and go there for 1.2 s, for 2.4 s, all the
    time, and all the time backward (noise about a standstill would not find these); the rest is the last solution with
    noise.
    """
    samples, steps = noise.shape[0], noise.shape[1]
    costs = np.zeros(samples)
    commands = np.empty((samples, steps, 2))
    follow = 1.0 - math.exp(-dt / lag)
    for k in range(samples):
        x, y, yaw, v, w, cv, cw = start
        total = 0.0
        for t in range(steps):
            wanted_v, wanted_w = plan[t, 0], plan[t, 1]
            if k == 1:
                wanted_v, wanted_w = 0.0, 0.0
            elif 2 <= k < 2 + 4 * BEARINGS:
                policy = (k - 2) // BEARINGS
                away = (k * 2.0 * math.pi / BEARINGS - yaw + math.pi) % (2.0 * math.pi) - math.pi
                wanted_w = TURN_GAIN * away
                wanted_v = (limits[0] if policy == 3 else limits[1]) * max(math.cos(away), 0.0) ** 2
                if (t + 1) * dt > (1.0 + policy) * 1.2 and policy < 2:
                    wanted_v = 0.0
            elif k > 0:
                wanted_v += noise[k, t, 0]
                wanted_w += noise[k, t, 1]
            wanted_v = min(max(wanted_v, limits[0]), limits[1])
            wanted_w = min(max(wanted_w, -limits[2]), limits[2])
            cv = _towards(cv, wanted_v, limits[3] * dt, limits[4] * dt)
            cw = cw + max(-limits[5] * dt, min(limits[5] * dt, wanted_w - cw))
            commands[k, t, 0] = cv
            commands[k, t, 1] = cw
            v += (cv - v) * follow
            w += (cw - w) * follow
            middle = yaw + 0.5 * w * dt
            x += v * math.cos(middle) * dt
            y += v * math.sin(middle) * dt
            yaw += w * dt
            c, s = math.cos(yaw), math.sin(yaw)
            later = 1.0 - 0.5 * t / steps
            free = 1e9
            for d in range(discs.shape[0]):
                px, py = x + c * discs[d, 0], y + s * discs[d, 0]
                free = min(free, _cell(distance, near_x, near_y, resolution, px, py, 0.0) - discs[d, 1])
            free -= 0.5 * resolution
            if free < 0.0:
                total += HIT * later
            elif free < 0.4:
                total += NEAR_STATIC * dt * math.exp(-free / STATIC_SCALE)
            time = (t + 1) * dt
            for m in range(movers.shape[0]):
                mx, my = movers[m, 0] + movers[m, 2] * time - x, movers[m, 1] + movers[m, 3] * time - y
                if abs(mx) > 2.5 or abs(my) > 2.5:
                    continue
                bx, by = c * mx + s * my, -s * mx + c * my
                away = -1e9
                for e in range(body_edges.shape[0]):
                    away = max(away, body_edges[e, 0] * bx + body_edges[e, 1] * by - body_edges[e, 2])
                away -= movers[m, 4] + MOVER_GROWTH * time
                if away < 0.0:
                    total += HIT * later * (1.0 - away)
                else:
                    total += NEAR_MOVER * dt * math.exp(-away / MOVER_SCALE)
            total += EFFORT * dt * (w * w + 0.2 * v * v)
            if v < 0.0:
                total -= BACKWARD * v * dt
        ahead = math.hypot(goal[0] - x, goal[1] - y)
        to_go = _cell(cost, map_x, map_y, resolution, x, y, np.inf)
        total += to_go if math.isfinite(to_go) else OFF_FIELD + ahead
        if ahead < 1.0:
            turned = (goal[2] - yaw + math.pi) % (2.0 * math.pi) - math.pi
            total += 0.3 * abs(turned) * (1.0 - ahead)
        costs[k] = total
    return costs, commands
