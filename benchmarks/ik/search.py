"""A pose search made of a controller's steps, for libraries that bring none: the same restarts for all of them.

Needs no more than numpy: it also runs in the environment of a rival that cannot live in ours.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.ik.walk import Array, Controller

LINEAR, ANGULAR = 1e-3, float(np.deg2rad(0.5))  # [m], [rad]
RESTARTS, STEPS = 20, 100
STALL = 10  # steps that must gain a tenth

Distance = Callable[[Array, Array], tuple[float, float]]  # q, target → [m], [rad]


@dataclass(frozen=True)
class Pair:
    """Where a search starts (n,), and the pose (3, 4) it is to find."""

    start: Array
    target: Array


@dataclass(frozen=True)
class Found:
    """What one search took [µs], whether it arrived, after how many restarts."""

    micros: float
    reached: bool
    restarts: int


def search_all(
    stepper: Controller, distance: Distance, lower: Array, upper: Array, pairs: Sequence[Pair]
) -> list[Found]:
    """Every pair, each with its own seeded restarts. The first is searched once more before, to warm up."""
    found = []
    for i, pair in enumerate([pairs[0], *pairs]):
        begun = time.perf_counter_ns()
        reached, restarts = _search(stepper, distance, lower, upper, pair, np.random.default_rng(i))
        found.append(Found((time.perf_counter_ns() - begun) / 1e3, reached, restarts))
    return found[1:]


def _search(
    stepper: Controller, distance: Distance, lower: Array, upper: Array, pair: Pair, random: np.random.Generator
) -> tuple[bool, int]:
    q, still, no_twist = pair.start, np.zeros(len(lower)), np.zeros(6)
    for restart in range(RESTARTS + 1):
        if restart:
            q = random.uniform(lower, upper)
        mark = np.inf
        for i in range(STEPS):
            linear, angular = distance(q, pair.target)
            if linear <= LINEAR and angular <= ANGULAR:
                return True, restart
            if i % STALL == 0:
                if linear + angular > 0.9 * mark:
                    break
                mark = linear + angular
            try:
                q = np.clip(q + stepper.step(q, still, pair.target, pair.target, no_twist), lower, upper)
            except Exception:  # a rival that finds no solution begins elsewhere
                break
    return False, RESTARTS
