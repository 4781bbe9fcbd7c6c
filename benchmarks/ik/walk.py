"""Controllers that walk a course step by step, and what that took. Needs no more than numpy: it also runs in the
environment of a rival that cannot live in ours.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

DT = 0.002  # [s] of a step
CHUNK = 50  # steps before it is the next controller's turn


class Controller(Protocol):
    """One step: commanded position and velocity (n,), pose (3, 4) where the tool ought to be now and after the step,
    twist (6,) between them → joint velocity (n,). Raises whatever it likes when it finds none."""

    name: str
    limits: str

    def step(self, q: Array, v: Array, now: Array, then: Array, twist: Array) -> Array: ...


@dataclass(frozen=True)
class Course:
    """A path in steps: ``poses`` (N+1, 3, 4), ``twists`` (N, 6), and the joints' ``start`` (n,)."""

    label: str
    start: Array
    poses: Array
    twists: Array


@dataclass
class Chunk:
    """What some steps took [µs], and the position and velocity after each."""

    micros: list[float] = field(default_factory=list)
    q: list[Array] = field(default_factory=list)
    v: list[Array] = field(default_factory=list)
    failed: int = 0


class Walker:
    """One controller on one course, from rest at its start."""

    def __init__(self, controller: Controller, course: Course) -> None:
        self._controller, self._course = controller, course
        self._q, self._v = course.start.copy(), np.zeros(len(course.start))
        still = np.zeros(6)  # compile and warm up
        controller.step(self._q, self._v, course.poses[0], course.poses[0], still)

    def walk(self, first: int, steps: int = CHUNK) -> Chunk:
        chunk, course, controller = Chunk(), self._course, self._controller
        q, v = self._q, self._v
        for i in range(first, first + steps):
            now, then, twist = course.poses[i], course.poses[i + 1], course.twists[i]
            begun = time.perf_counter_ns()
            try:
                v = controller.step(q, v, now, then, twist)
            except Exception:  # a rival that finds no solution stands still for this step
                v, chunk.failed = np.zeros(len(q)), chunk.failed + 1
            chunk.micros.append((time.perf_counter_ns() - begun) / 1e3)
            q = q + v * DT
            chunk.q.append(q)
            chunk.v.append(v)
        self._q, self._v = q, v
        return chunk
