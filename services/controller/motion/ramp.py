"""From one velocity to another with bounded acceleration and jerk, on the straight line between them."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.arrays import Array

_TINY = 1e-12
REMEMBERED, AVERAGED = 0.2, 0.096
"""Seconds: of a reference, how long what it was before is looked at, and over how long it is averaged."""


class Reference:
    """A velocity reference as a ramp may follow it: a stream that changes back and forth counts as its mean.

    A ramp with bounded acceleration goes towards the reference of the moment at the same rate however far that is, so
    that it has no tendency towards the mean of two that alternate faster than it can follow: where it is when they
    begin, it stays, and the tool drifts. So the mean over ``AVERAGED`` seconds takes the place of the newest value as
    far as the changes of the last ``REMEMBERED`` seconds cancel each other; a reference that changes in one direction
    only is not delayed.
    """

    def __init__(self, size: int, dt: float) -> None:
        self._last = np.zeros((max(round(REMEMBERED / dt), 2), size))
        self._averaged = max(round(AVERAGED / dt), 1)
        self._constant = len(self._last)  # periods since the last change

    def step(self, value: Array) -> Array:
        """What to follow for a period, with ``value`` as the newest reference."""
        last = self._last
        self._constant = self._constant + 1 if np.array_equal(value, last[-1]) else 0
        last[:-1] = last[1:]
        last[-1] = value
        if self._constant >= len(last):
            return value
        varied = float(np.linalg.norm(np.diff(last, axis=0), axis=1).sum())
        changed = float(np.linalg.norm(last[-1] - last[0]))
        share = min(1.0, 2.0 * (1.0 - changed / max(varied, _TINY)))
        return np.asarray(value + share * (last[-self._averaged :].mean(axis=0) - value))


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
