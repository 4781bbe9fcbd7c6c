"""A joint-space curve q(s) as quintic Hermite pieces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array


@dataclass(frozen=True)
class JointCurve:
    """q(s) through knots with given first and second derivatives: twice continuously differentiable.

    ``s`` (k,) does not decrease. Two knots at the same s with the same q are a corner, which can only be passed at
    rest. ``q``, ``dq``, ``ddq`` are (k, n): value, d/ds, d²/ds².
    """

    s: Array
    q: Array
    dq: Array
    ddq: Array

    @property
    def start(self) -> float:
        return float(self.s[0])

    @property
    def end(self) -> float:
        return float(self.s[-1])

    def derivatives(self, s: Array, left: bool = False) -> Array:
        """(4, m, n): q and its first three derivatives at ``s`` (m,), held to [start, end].

        Where derivatives jump (the third at every knot, all at a corner), ``left`` takes the limit from below.
        """
        out = np.empty((4, s.size, self.q.shape[1]))
        _hermite(self.s, self.q, self.dq, self.ddq, s, left, out)
        return out

    def joined(self, tail: JointCurve, corner: bool) -> JointCurve:
        """This curve up to where ``tail`` begins, then ``tail``; with a ``corner`` between the two."""
        keep = int(np.searchsorted(self.s, tail.start + (1e-12 if corner else -1e-12)))
        parts = ((getattr(self, name)[:keep], getattr(tail, name)) for name in ("s", "q", "dq", "ddq"))
        return JointCurve(*(np.concatenate(pair) for pair in parts))

    def from_(self, s: float) -> JointCurve:
        """Without the pieces that end at or before ``s``, to 1e-9."""
        first = max(0, min(int(np.searchsorted(self.s, s + 1e-9, side="right")) - 1, self.s.size - 2))
        return JointCurve(self.s[first:], self.q[first:], self.dq[first:], self.ddq[first:])


@compiled
def _hermite(knots: Array, q: Array, dq: Array, ddq: Array, at: Array, left: bool, out: Array) -> None:
    last = knots.size - 2
    for m in range(at.size):
        s = min(max(at[m], knots[0]), knots[-1])
        k = np.searchsorted(knots, s) - 1 if left else np.searchsorted(knots, s, side="right") - 1
        k = min(max(k, 0), last)
        h = knots[k + 1] - knots[k]
        d = s - knots[k]
        for j in range(q.shape[1]):
            c2 = 0.5 * ddq[k, j]
            # What a parabola from the left knot misses at the right one, in value, slope and curvature.
            e0 = q[k + 1, j] - q[k, j] - h * (dq[k, j] + h * c2)
            e1 = (dq[k + 1, j] - dq[k, j] - 2 * h * c2) * h
            e2 = (ddq[k + 1, j] - ddq[k, j]) * h * h
            c3 = (10 * e0 - 4 * e1 + 0.5 * e2) / h**3
            c4 = (-15 * e0 + 7 * e1 - e2) / h**4
            c5 = (6 * e0 - 3 * e1 + 0.5 * e2) / h**5
            out[0, m, j] = q[k, j] + d * (dq[k, j] + d * (c2 + d * (c3 + d * (c4 + d * c5))))
            out[1, m, j] = dq[k, j] + d * (2 * c2 + d * (3 * c3 + d * (4 * c4 + d * 5 * c5)))
            out[2, m, j] = 2 * c2 + d * (6 * c3 + d * (12 * c4 + d * 20 * c5))
            out[3, m, j] = 6 * c3 + d * (24 * c4 + d * 60 * c5)
