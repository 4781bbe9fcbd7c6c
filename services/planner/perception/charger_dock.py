"""Charging docks in a scan: two plates that meet in a V, open towards the chassis.

A group of neighbouring hits as wide as the V is a candidate; its pose is fitted by least squares on the signed distance
of each hit to its plate, and on the bearings of the two outer edges, which say most about where the V is sideways.

The frame of a dock has its origin where the chassis' origin is when it is docked, and x along the axis of the V, away
from it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.explain import Measure, Thing
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.perception.miss import Miss

Array = NDArray[np.float64]

GAP = 0.1  # m between neighbouring hits of one group
FEWEST = 12  # hits of a V
SEARCH_RADIUS, SEARCH_YAW = 0.6, math.radians(25)  # off the prior pose
ELSEWHERE = 2.5  # m off it, within which one that was moved is looked for to explain the failure
LEAST_WIDTH, MOST_WIDTH = 0.75, 1.25  # share of the V's width that the ends of a group may be apart
WORST_RMS = 0.018  # m; a flat wall as wide as the V has about 0.03
EDGE_NOISE = 0.008  # m, 1σ of an outer edge; 0.01 of a hit
HIT_NOISE = 0.01
OUTLIER = 2.5  # standard deviations from which on a hit counts less (Huber)
ITERATIONS, DELTA, SETTLED = 12, 1e-5, 1e-4


class DockShape(NamedTuple):
    """A V in metres and radians. ``apex``: from the docked chassis' origin back to where the plates meet. ``half``: the
    angle of a plate to the axis. ``plate``: its length. ``tip``: the outermost point, along the axis from the apex and
    beside it."""

    apex: float = 0.5634
    half: float = math.radians(65)
    plate: float = 0.253
    tip: tuple[float, float] = (0.0797, 0.2417)


class DockSighting(NamedTuple):
    """One dock in one scan: pose of its frame, number of hits, residual in metres."""

    pose: Pose
    hits: int
    rms: float


def find_dock(points: Array, sensor: Array, prior: Pose, shape: DockShape) -> DockSighting | None:
    """The dock near ``prior``; all in one frame. ``points``: (n, 2) in the order of the beams; ``sensor``: x, y."""
    at = np.asarray(sensor[:2], dtype=np.float64)
    fits = [_fit(group, at, shape) for group in _groups(points) if _is_as_wide(group, shape)]
    near = [fit for fit in fits if fit.rms <= WORST_RMS and _is_near(fit.pose, prior)]
    return min(near, key=lambda fit: fit.rms, default=None)


def describe_miss(points: Array, sensor: Array, prior: Pose, shape: DockShape) -> Miss:
    """What is near ``prior`` instead of a dock, and where one is seen that is too far from it."""
    at = np.asarray(sensor[:2], dtype=np.float64)
    fits = [_fit(group, at, shape) for group in _groups(points) if _is_as_wide(group, shape)]
    near = [fit for fit in fits if _is_near(fit.pose, prior)]
    where = (
        f"within {SEARCH_RADIUS:.1f} m and {math.degrees(SEARCH_YAW):.0f} degrees of ({prior[0]:.2f}, {prior[1]:.2f})"
    )
    if near:
        best = min(near, key=lambda fit: fit.rms)
        text = f"what is seen {where} is off the dock's shape by {1e3 * best.rms:.0f} mm rms, want"
        off = Measure(name="misfit of the shape", value=round(best.rms, 4), expected=WORST_RMS, unit="m")
        seen = Thing(role="seen", kind="place", x=round(best.pose[0], 3), y=round(best.pose[1], 3))
        return Miss(f"{text} {1e3 * WORST_RMS:.0f} mm", (seen,), (off,))
    others = [(_away(fit.pose, prior), fit.pose) for fit in fits if fit.rms <= WORST_RMS]
    away, other = min(others, key=lambda found: found[0], default=(math.inf, prior))
    if away > ELSEWHERE:
        return Miss(f"no V of two plates is seen {where}")
    text = f"no V of two plates is seen {where}; one is seen at ({other[0]:.2f}, {other[1]:.2f}), {away:.2f} m away"
    moved = Measure(
        name="distance of the charger from its place", value=round(away, 3), expected=SEARCH_RADIUS, unit="m"
    )
    return Miss(text, (Thing(role="seen", kind="charger", x=round(other[0], 3), y=round(other[1], 3)),), (moved,))


def _is_near(pose: Pose, prior: Pose) -> bool:
    return _away(pose, prior) <= SEARCH_RADIUS and abs(wrap(pose[2] - prior[2])) <= SEARCH_YAW


def _away(pose: Pose, prior: Pose) -> float:
    return float(math.hypot(pose[0] - prior[0], pose[1] - prior[1]))


def _groups(points: Array) -> list[Array]:
    """Hits that follow each other closely, each group (n, 2) with at least ``FEWEST``."""
    if not len(points):
        return []
    breaks = np.nonzero(np.hypot(*np.diff(points, axis=0).T) > GAP)[0] + 1
    groups = np.split(points, breaks)
    if len(groups) > 1 and np.hypot(*(points[-1] - points[0])) <= GAP:
        groups[0] = np.vstack([groups.pop(), groups[0]])
    return [group for group in groups if len(group) >= FEWEST]


def _is_as_wide(group: Array, shape: DockShape) -> bool:
    width = math.hypot(*(group[-1] - group[0])) / (2.0 * shape.tip[1])
    return LEAST_WIDTH <= width <= MOST_WIDTH


def _fit(group: Array, sensor: Array, shape: DockShape) -> DockSighting:
    """Gauss–Newton on the apex and the axis, from the chord of the group."""
    middle, chord = 0.5 * (group[0] + group[-1]), group[-1] - group[0]
    axis = np.array([-chord[1], chord[0]]) / math.hypot(*chord)
    if axis @ (sensor - middle) < 0.0:
        axis = -axis
    apex = np.array([*(middle - shape.tip[0] * axis), math.atan2(axis[1], axis[0])])
    ends = np.array([_bearing(group[0], sensor), _bearing(group[-1], sensor)])
    for _ in range(ITERATIONS):
        error = _residuals(apex, group, ends, sensor, shape)
        jacobian = np.column_stack(
            [(_residuals(apex + DELTA * unit, group, ends, sensor, shape) - error) / DELTA for unit in np.eye(3)]
        )
        weights = np.minimum(OUTLIER / np.maximum(np.abs(error), 1e-9), 1.0)
        step = np.linalg.solve(jacobian.T @ (weights[:, None] * jacobian), -jacobian.T @ (weights * error))
        apex = apex + np.clip(step, -0.1, 0.1)
        if np.abs(step).max() < SETTLED:
            break
    apex[2] = wrap(apex[2])
    error = HIT_NOISE * _residuals(apex, group, ends, sensor, shape)[:-2]
    docked = se2.compose(apex, np.array([shape.apex, 0.0, 0.0]))
    return DockSighting(docked, len(group), float(np.sqrt(np.mean(error**2))))


def _residuals(apex: Pose, group: Array, ends: Array, sensor: Array, shape: DockShape) -> Array:
    """In standard deviations: each hit from its plate (n,), then each outer edge aside (2,)."""
    own = se2.transformed(se2.between(apex, np.zeros(3)), group)
    off = own[:, 0] * math.sin(shape.half) - np.abs(own[:, 1]) * math.cos(shape.half)
    tips = se2.transformed(apex, np.array([(shape.tip[0], shape.tip[1]), (shape.tip[0], -shape.tip[1])]))
    expected = np.array([_bearing(tip, sensor) for tip in tips])
    if abs(wrap(ends[0] - expected[0])) > abs(wrap(ends[0] - expected[1])):
        expected = expected[::-1]
    away = math.hypot(*(apex[:2] - sensor))
    aside = [away * wrap(float(e - x)) for e, x in zip(ends, expected, strict=True)]
    return np.concatenate([off / HIT_NOISE, np.array(aside) / EDGE_NOISE])


def _bearing(point: Array, sensor: Array) -> float:
    return math.atan2(point[1] - sensor[1], point[0] - sensor[0])
