"""From one velocity to another with bounded acceleration and jerk, on the straight line between them."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.arrays import Array

_TINY = 1e-12
AVERAGED = 0.048
"""Seconds over which references are averaged: what changes at each message of a stream, 8 to 24 ms apart, is noise that
a ramp would turn into drift, because it answers the first change before it answers the second."""


class Average:
    """Mean of a vector over the last ``AVERAGED`` seconds, from zero on."""

    def __init__(self, size: int, dt: float) -> None:
        self._last = np.zeros((max(round(AVERAGED / dt), 1), size))
        self._next = 0

    def step(self, value: Array) -> Array:
        """The mean with ``value`` as the newest one."""
        self._last[self._next] = value
        self._next = (self._next + 1) % len(self._last)
        return np.asarray(self._last.mean(axis=0))


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
