"""What tests of an arm in physics check: tools, speeds, limits of what was commanded and measured."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.motion import ArmCommand, ArmState
from rackhand.services.controller import ik

Array = NDArray[np.float64]

ARM = ik.load_arm("ur5e")
OK = {"value": True, "code": 200, "detail": 0}
BAD = {"code": 400, "detail": 0}
PERIOD = 0.004  # seconds between commands


def tools(states: list[ArmState], arm: ik.Arm = ARM) -> Array:
    """Poses (m, 3, 4) of the tool."""
    return np.array([ik.forward(arm, np.array(state.q)) for state in states])


def speeds(states: list[ArmState]) -> Array:
    """Fastest joint of each state, rad/s."""
    return np.array([max(map(abs, state.dq)) for state in states])


def pose(matrix: Array) -> dict[str, Any]:
    rows = {f"Row{i + 1}": matrix[i, :3].tolist() for i in range(3)}
    return {"Position": matrix[:, 3].tolist(), "Orientation": {"Matrix": rows}}


def off_line(line: Array, point: Array) -> float:
    """Distance (m) from a point to a polyline (m, 3) of short pieces."""
    nearest = int(np.linalg.norm(line - point, axis=1).argmin())
    pieces = [(a, b - a) for a, b in pairwise(line[max(nearest - 1, 0) : nearest + 2]) if (a != b).any()]
    return min(float(np.linalg.norm(np.cross(d, point - a)) / np.linalg.norm(d)) for a, d in pieces)


def blended(corners: list[Array], deviation: float = 0.01) -> Array:
    """The outline every 0.2 mm: straight legs, corners rounded by the documented quintic that passes them by
    ``deviation`` at most (x = a t₁ + b t₂, b = 2r(u³ − u⁴/2), 3r/16·|t₂ − t₁| = deviation)."""
    out: list[Array] = []
    legs = list(pairwise(corners))
    directions = [(b - a) / np.linalg.norm(b - a) for a, b in legs]
    radius = [0.0]
    for first, second, leg, after in zip(directions, directions[1:], legs, legs[1:], strict=False):
        bend = np.linalg.norm(second - first)
        longest = min(np.linalg.norm(leg[1] - leg[0]), np.linalg.norm(after[1] - after[0])) / 2
        radius.append(float(min(16 * deviation / (3 * bend), longest)) if bend > 1e-9 else 0.0)
    radius.append(0.0)
    for i, (a, b) in enumerate(legs):
        length = np.linalg.norm(b - a)
        out += [a + d * directions[i] for d in np.arange(radius[i], length - radius[i + 1], 2e-4)]
        r = radius[i + 1]
        if r > 0:
            for u in np.linspace(0, 1, int(2 * r / 2e-4)):
                second = 2 * r * (u**3 - u**4 / 2)
                first = (2 * u - 1) * r - second
                out.append(b + first * directions[i] + second * directions[i + 1])
    return np.array([*out, corners[-1]])


def check_commands(commands: list[ArmCommand], arm: ik.Arm, jerk: bool = True) -> None:
    """Position, velocity, acceleration and jerk limits of what is commanded, period by period."""
    assert {command.mode for command in commands} == {"position"}
    stamps = np.array([command.answers for command in commands])
    q = np.array([command.values for command in commands])
    limits = arm.limits
    assert (q >= limits.lower - 1e-9).all() and (q <= limits.upper + 1e-9).all()
    gaps = np.flatnonzero(np.diff(stamps) != round(PERIOD * 1e9)) + 1
    assert gaps.size < 0.02 * len(commands), "too much went past this client"
    for run in np.split(q, gaps):
        bounds = (1.001 * limits.velocity, 1.01 * limits.acceleration, 1.02 * limits.jerk)
        for n, bound in enumerate(bounds if jerk else bounds[:2], start=1):
            rates = np.abs(np.diff(run, n, axis=0)) / PERIOD**n
            assert (rates <= bound).all(), (n, rates.max(axis=0))


def check_limits(states: list[ArmState], arm: ik.Arm, overshoot: float = 1.05) -> None:
    """As measured: positions, velocities, and accelerations over one control period, these up to ``overshoot``."""
    q, dq = np.array([s.q for s in states]), np.array([s.dq for s in states])
    t = np.array([s.stamp for s in states]) * 1e-9
    limits = arm.limits
    assert (q >= limits.lower - 1e-4).all() and (q <= limits.upper + 1e-4).all()
    assert (np.abs(dq) <= 1.01 * limits.velocity).all(), np.abs(dq).max(axis=0)
    ddq = (dq[2:] - dq[:-2]) / (t[2:] - t[:-2])[:, None]
    assert (np.abs(ddq) <= overshoot * limits.acceleration).all(), np.abs(ddq).max(axis=0)


def first_rest(states: list[ArmState], since: int) -> float:
    """ms from ``since`` until no joint is faster than 1 mrad/s for good."""
    last = max(s.stamp for s, v in zip(states, speeds(states), strict=True) if v > 1e-3)
    return (last - since) / 1e6
