"""From one velocity to another with bounded acceleration and jerk, on the straight line between them."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.arrays import Array

_TINY = 1e-12


class Ramp:
    """A velocity vector that follows a reference. Units are the caller's; all bounds are per component."""

    def __init__(self, size: int) -> None:
        self.velocity = np.zeros(size)
        self.acceleration = np.zeros(size)

    def step(self, target: Array, acceleration: Array, jerk: Array, dt: float) -> Array:
        """The velocity after ``dt``.

        All components arrive together: of the direction to go, the acceleration is what the tightest component allows,
        and so small near the end that it still can fade at the jerk limit (√(2 J e), in discrete time).
        """
        gap = target - self.velocity
        size = float(np.linalg.norm(gap))
        if size < _TINY:
            wanted = np.zeros_like(gap)
        else:
            along = np.maximum(np.abs(gap) / size, _TINY)
            most, change = float((acceleration / along).min()), float((jerk / along).min())
            half = 0.5 * change * dt
            fading = np.sqrt(half * half + 2 * change * size) - half
            wanted = gap / size * min(most, fading, size / dt)
        turn = wanted - self.acceleration
        # Ending exactly on the reference is worth more than the last, tiny step of jerk.
        if size / dt > float((jerk * dt).max()):
            turn /= max(1.0, float((np.abs(turn) / (jerk * dt)).max()))
        self.acceleration = self.acceleration + turn
        self.velocity = self.velocity + self.acceleration * dt
        return self.velocity

    def slow(self, factor: float) -> Array:
        """Scales velocity and acceleration by ``factor`` 0 … 1; the next step starts from there. Returns the
        velocity."""
        self.velocity, self.acceleration = factor * self.velocity, factor * self.acceleration
        return self.velocity

    def cut(self, velocity: Array) -> None:
        """Another limit allowed only ``velocity``: the next step starts from there, without the acceleration that was
        cut."""
        self.acceleration = np.where(velocity == self.velocity, self.acceleration, 0.0)
        self.velocity = velocity.copy()
