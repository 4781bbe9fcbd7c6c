"""Running a servo against a moving target, with every limit checked at every tick."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin

from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik import DifferentialIk, Step

Path = Callable[[float], Array]  # time [s] → pose (3, 4)


@dataclass
class Run:
    steps: list[Step] = field(default_factory=list)
    q: list[Array] = field(default_factory=list)
    v: list[Array] = field(default_factory=list)

    def errors_mm(self) -> Array:
        return np.array([1e3 * step.linear_error for step in self.steps])


def moved(
    pose: Array, shift: tuple[float, ...] | Array = (0, 0, 0), turn: tuple[float, ...] | Array = (0, 0, 0)
) -> Array:
    """The pose shifted and turned about its own origin, both in base axes."""
    return np.hstack([pin.exp3(np.array(turn, float)) @ pose[:, :3], (pose[:, 3] + np.array(shift, float))[:, None]])


def twist_between(a: Array, b: Array, dt: float) -> Array:
    """The twist (base axes, at the tool) that leads from pose a to b in dt."""
    return np.concatenate([b[:, 3] - a[:, 3], pin.log3(b[:, :3] @ a[:, :3].T)]) / dt


def follow(ik: DifferentialIk, path: Path, seconds: float, q: Array) -> Run:
    """Follow ``path``, starting at rest in q, and hold every limit to be kept."""
    run, v, limits = Run(), np.zeros(len(q)), ik.arm.limits
    for i in range(round(seconds / ik.dt)):
        now, then = path(i * ik.dt), path((i + 1) * ik.dt)
        step = ik.step(q, v, now, twist_between(now, then, ik.dt))
        run.steps.append(step)
        assert np.all(np.abs(step.velocity) <= limits.velocity * (1 + 1e-9))
        assert np.all(np.abs(step.velocity - v) <= limits.acceleration * ik.dt * (1 + 1e-9))
        v = step.velocity
        q = q + v * ik.dt
        assert np.all(q >= limits.lower - 1e-9)
        assert np.all(q <= limits.upper + 1e-9)
        run.q.append(q)
        run.v.append(v)
    return run


def eased(t: float, duration: float) -> float:
    """0 → 1 with zero speed at both ends."""
    return float(0.5 - 0.5 * np.cos(np.pi * min(max(t / duration, 0.0), 1.0)))
