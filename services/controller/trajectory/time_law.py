"""The time law s(t): what TOPP-RA plans, piecewise with constant s̈, and the filter that bounds its jerk."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array


@dataclass(frozen=True)
class Smoothing:
    """Two box filters of these lengths, seconds, the longer first.

    s̈ changes by Δ no faster than Δ/``long`` and that rate itself is continuous. The result comes to rest ``total``
    later than planned; it is delayed only, so the path is kept.
    """

    long: float = 0.03
    short: float = 0.01

    def __post_init__(self) -> None:
        if not 0 < self.short <= self.long:
            raise ValueError(f"box lengths must be 0 < short <= long, not {self.short} and {self.long}")

    @classmethod
    def for_limits(cls, acceleration: Array, jerk: Array) -> Smoothing:
        """Boxes long enough for a change from full deceleration to full acceleration at most at ``jerk`` (n,)."""
        long = max(0.02, 2.1 * float((acceleration / jerk).max()))
        return cls(long, 0.25 * long)

    @property
    def total(self) -> float:
        return self.long + self.short


@dataclass(frozen=True)
class TimeLaw:
    """s(t) with constant acceleration ``a`` from every knot on: times ``t``, ``s``, speeds ``v``, all (K,).

    Before the first knot it is taken as at constant speed, after the last one it is constant.
    """

    t: Array
    s: Array
    v: Array
    a: Array

    @property
    def end(self) -> float:
        """When the unfiltered s(t) comes to rest."""
        return float(self.t[-1])

    def at(self, t: float) -> tuple[float, float]:
        """s and ṡ, unfiltered."""
        k = max(int(np.searchsorted(self.t, t, side="right")) - 1, 0)
        d = t - self.t[k] if k < self.t.size - 1 else 0.0
        acceleration = self.a[k] if d > 0 else 0.0
        return float(self.s[k] + d * (self.v[k] + d * acceleration / 2)), float(self.v[k] + d * acceleration)

    def cut(self, t: float, keep: float) -> TimeLaw:
        """What happened until ``t``, from ``keep`` seconds before it on."""
        s, v = self.at(t)
        first = max(int(np.searchsorted(self.t, t - keep, side="right")) - 1, 0)
        last = int(np.searchsorted(self.t, t))
        part = [np.append(row[first:last], value) for row, value in zip(self._rows(), (t, s, v, 0.0), strict=True)]
        return TimeLaw(*part)

    def then(self, later: TimeLaw) -> TimeLaw:
        """Continues as ``later``, which begins where and when this one ends."""
        rows = zip(self._rows(), later._rows(), strict=True)
        return TimeLaw(*(np.concatenate([mine[:-1], theirs]) for mine, theirs in rows))

    def filtered(self, t: Array, smoothing: Smoothing) -> Array:
        """(m, 4): smoothed s, ṡ, s̈, s⃛ at the times ``t`` (m,)."""
        out = np.empty((t.size, 4))
        _filter(self.t, self.s, self.v, self.a, t, smoothing.long, smoothing.short, out)
        return out

    def _rows(self) -> tuple[Array, Array, Array, Array]:
        return self.t, self.s, self.v, self.a


def at_rest(t: float, s: float) -> TimeLaw:
    return TimeLaw(np.array([t]), np.array([s]), np.zeros(1), np.zeros(1))


def time_law_from(start: float, s: Array, x: Array, u: Array, end: float, pause: float) -> TimeLaw:
    """The law that begins at time ``start`` and has ṡ² = x (N,), s̈ = u (N-1,) over s (N,), until s = ``end``.

    Where the grid has a point twice, a corner, it rests for ``pause`` seconds: the length of the filter.
    """
    last = max(int(np.searchsorted(s, end)), 1)
    s, v, u = s[: last + 1].copy(), np.sqrt(x[: last + 1]), u[:last].copy()
    s[-1] = end
    v[-1] = 0.0
    h = np.diff(s)
    moving = h > 0
    duration = np.where(~moving & np.append(moving[1:], False), pause, 0.0)
    duration[moving] = 2 * h[moving] / np.maximum(v[1:][moving] + v[:-1][moving], 1e-9)
    # From the times, so that s, ṡ and t agree to rounding.
    u[moving] = (v[1:] - v[:-1])[moving] / duration[moving]
    u[~moving] = 0.0
    t = start + np.concatenate([[0.0], np.cumsum(duration)])
    distinct = np.append(duration > 0, True)
    return TimeLaw(t[distinct], s[distinct], v[distinct], np.append(u, 0.0)[distinct])


@compiled
def _filter(T: Array, S: Array, V: Array, A: Array, times: Array, long: float, short: float, out: Array) -> None:
    """Both boxes integrated exactly: from the window's begin, s and its first and second integral are carried along the
    pieces, and read at the four times that the second difference of the double integral needs."""
    area = long * short
    for m in range(times.size):
        t = times[m]
        now = t - long - short
        marks = (t - long, t - short, t)
        k = np.searchsorted(T, now, side="right") - 1
        d = now - T[max(k, 0)]
        a = A[k] if k >= 0 else 0.0
        v = V[max(k, 0)] + a * d
        origin = S[max(k, 0)] + d * (V[max(k, 0)] + 0.5 * a * d)
        y, first, second = 0.0, 0.0, 0.0
        sum_v, sum_s, sum_1, sum_2 = v, 0.0, 0.0, 0.0
        for mark in range(3):
            while now < marks[mark]:
                until = marks[mark]
                if k + 1 < T.size and T[k + 1] < until:
                    until = T[k + 1]
                d = until - now
                second += d * (first + d * (y / 2 + d * (v / 6 + d * a / 24)))
                first += d * (y + d * (v / 2 + d * a / 6))
                y += d * (v + d * a / 2)
                v += d * a
                now = until
                if k + 1 < T.size and now >= T[k + 1]:
                    k += 1
                    v, a = V[k], A[k]
            sign = 1.0 if mark == 2 else -1.0
            sum_v += sign * v
            sum_s += sign * y
            sum_1 += sign * first
            sum_2 += sign * second
        out[m, 0] = origin + sum_2 / area
        out[m, 1] = sum_1 / area
        out[m, 2] = sum_s / area
        out[m, 3] = sum_v / area
