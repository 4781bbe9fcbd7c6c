"""The time law of a path: rows of limits along s, TOPP-RA over them, and a check of what comes out of the filter."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.curve import JointCurve
from rackhand.services.controller.trajectory.geometry import TaskPath
from rackhand.services.controller.trajectory.model import JointLimits, Kinematics, TaskLimits
from rackhand.services.controller.trajectory.time_law import Smoothing, TimeLaw, at_rest, time_law_from
from rackhand.services.controller.trajectory.topp import controllable, drive

_AT_REST = 1e-9
_SAME = 1e-12
_MOST_CHECKS = 50_000
_BRAKING = (1.0, 0.95, 0.9, 0.8)
"""Shares of the planned acceleration that a stop tries until what leaves the filter keeps the limits."""


@dataclass(frozen=True)
class Planning:
    """Grid, filter, and how much of the limits is planned with.

    The filter mixes what is allowed at neighbouring s, so ``velocity`` and ``acceleration`` shares of the limits are
    planned with. The result is sampled every ``check`` seconds; where it exceeds a limit by more than ``slack``, these
    shares are lowered around there and the path is timed again, at most ``rounds`` times.
    """

    velocity: float = 0.998
    acceleration: float = 0.985
    grid: float = 0.02
    pieces: int = 12
    smoothing: Smoothing = field(default_factory=Smoothing)
    check: float = 0.002
    slack: float = 0.002
    rounds: int = 8


@dataclass(frozen=True)
class PathConstraints:
    """Limits along the grid ``s`` (N,), each divided by what is allowed there.

    ``rest`` (N,) is 1 at corners, where ṡ = 0. ``speed`` (N,): ṡ·speed ≤ 1. ``A``, ``B`` (N, m): |A s̈ + B ṡ²| ≤ 1, the
    joints' rows first. ``joints`` (N, 3, n): the limits of joint velocity, acceleration and jerk themselves.
    """

    s: Array
    rest: Array
    speed: Array
    A: Array
    B: Array
    joints: Array

    def between(self, first: float, last: float = np.inf) -> PathConstraints:
        """From ``first``, where a grid point is put, up to but without ``last``. A corner there is kept whole."""
        parts = (self.s, self.rest, self.speed, self.A, self.B, self.joints)
        end = int(np.searchsorted(self.s, last))
        k = int(np.searchsorted(self.s, first - _SAME))
        if k < self.s.size - 1 and self.s[k] <= first + _SAME:
            return PathConstraints(*(row[k:end] for row in parts))
        k = min(max(k, 1), self.s.size - 1)
        first = min(max(first, float(self.s[0])), float(self.s[-1]))
        w = (first - self.s[k - 1]) / (self.s[k] - self.s[k - 1])
        return PathConstraints(*(np.concatenate([[(1 - w) * row[k - 1] + w * row[k]], row[k:end]]) for row in parts))

    def joined(self, tail: PathConstraints) -> PathConstraints:
        """These, then ``tail``. Where one of the two has more rows, the other's are empty."""
        width = max(self.A.shape[1], tail.A.shape[1])
        parts = ((p.s, p.rest, p.speed, _widened(p.A, width), _widened(p.B, width), p.joints) for p in (self, tail))
        return PathConstraints(*(np.concatenate(pair) for pair in zip(*parts, strict=True)))


def rows(
    curve: JointCurve,
    joints: JointLimits,
    planning: Planning,
    task: TaskLimits | None = None,
    path: TaskPath | None = None,
    kinematics: Kinematics | None = None,
) -> PathConstraints:
    """The constraints of ``curve`` under ``joints`` limits and, if given, ``task`` limits.

    The TCP's motion is that of ``path`` where the curve follows one; otherwise it is computed by ``kinematics``.
    """
    s, left = _grid(curve, planning)
    q = np.where(left[:, None], curve.derivatives(s, left=True), curve.derivatives(s))
    speed = np.abs(q[1] / joints.velocity).max(axis=1)
    a_rows, b_rows = q[1] / joints.acceleration, q[2] / joints.acceleration
    if task is not None:
        first, second = _tcp(s, left, q, path, kinematics)
        for part in (slice(0, 3), slice(3, 6)):
            speed = np.maximum(speed, np.linalg.norm(first[:, part] / task.velocity[part], axis=1))
        a_rows = np.concatenate([a_rows, first / task.acceleration], axis=1)
        b_rows = np.concatenate([b_rows, second / task.acceleration], axis=1)
    rest = np.append(np.diff(s) == 0, False)
    rest[1:] |= rest[:-1]
    allowed = np.tile(np.stack([joints.velocity, joints.acceleration, joints.jerk]), (s.size, 1, 1))
    return PathConstraints(
        s, rest.astype(float), speed, np.ascontiguousarray(a_rows), np.ascontiguousarray(b_rows), allowed
    )


@dataclass(frozen=True)
class Timed:
    """A law, and how much of the velocity, acceleration and jerk limits it uses at worst (1 = all).

    ``feasible`` is False if the state it began with was too fast for the path.
    """

    law: TimeLaw
    use: tuple[float, float, float]
    feasible: bool = True


def plan(
    curve: JointCurve, all_rows: PathConstraints, planning: Planning, now: TimeLaw | None = None, rate: float = 1.0
) -> Timed:
    """The fastest law to the end of the ``curve`` under its rows.

    ``now`` is what has been driven so far, up to the moment at which the plan begins; None begins at rest at time 0.
    ``rate`` in (0, 1] scales the velocity limits.
    """
    now = now or at_rest(0.0, float(all_rows.s[0]))
    here = all_rows.between(float(now.s[-1]))
    share = np.full((2, here.s.size), [[planning.velocity], [planning.acceleration]])
    best = timed = _timed(curve, here, planning, now, rate, share)
    for again in range(planning.rounds):
        if max(best.use) <= 1 + planning.slack:
            break
        ratios = _ratios(curve, here, timed.law, planning, now.end)
        _lower(share, here, timed.law, planning, *ratios, everywhere=again >= planning.rounds // 2)
        timed = _timed(curve, here, planning, now, rate, share)
        # What has begun may not allow more caution: then the best so far stays.
        if max(timed.use) < max(best.use):
            best = replace(timed, feasible=best.feasible)
    return best


def brake(curve: JointCurve, all_rows: PathConstraints, planning: Planning, now: TimeLaw) -> Timed:
    """From where ``now`` ends to rest along the ``curve``, as soon as its limits allow."""
    here = all_rows.between(float(now.s[-1]))
    tries = []
    for share in _BRAKING:
        c = np.full(here.s.size, share * planning.acceleration)
        x, u, end = drive(here.s, here.A, here.B, c, np.zeros(here.s.size), float(now.v[-1]) ** 2, 0.0, True)
        if x[-1] > _AT_REST and end == here.s[-1]:
            # Too gentle to stop before the end.
            continue
        law = now.then(time_law_from(now.end, here.s, x, u, end, planning.smoothing.total))
        tries.append(Timed(law, _use(curve, here, law, planning, now.end)))
        if max(tries[-1].use) <= 1 + planning.slack:
            break
    return min(tries, key=lambda tried: max(tried.use))


def _timed(
    curve: JointCurve, here: PathConstraints, planning: Planning, now: TimeLaw, rate: float, share: Array
) -> Timed:
    ceiling = (rate * share[0] / np.maximum(here.speed, 1e-9)) ** 2
    ceiling[here.rest == 1] = 0.0
    ceiling[-1] = 0.0
    x0, reserve = float(now.v[-1]) ** 2, 1 - planning.acceleration
    beta = controllable(here.s, here.A, here.B, share[1], ceiling)
    x, u, end = drive(here.s, here.A, here.B, share[1], beta, x0, reserve, False)
    law = now.then(time_law_from(now.end, here.s, x, u, end, planning.smoothing.total))
    if x[ceiling == 0].max() > _AT_REST:
        return Timed(law, (np.inf, np.inf, np.inf), feasible=False)
    use = _use(curve, here, law, planning, now.end)
    return Timed(law, use, x0 <= (1 + 2 * reserve) * beta[0] + 1e-12)


def _use(
    curve: JointCurve, here: PathConstraints, law: TimeLaw, planning: Planning, start: float
) -> tuple[float, float, float]:
    worst = _ratios(curve, here, law, planning, start)[1].max(axis=0, initial=0.0)
    return float(worst[0]), float(worst[1]), float(worst[2])


def _ratios(
    curve: JointCurve, here: PathConstraints, law: TimeLaw, planning: Planning, start: float
) -> tuple[Array, Array]:
    """Times (k,) from ``start`` on, and (k, 3) the largest use of velocity, acceleration and jerk limits at each."""
    end = law.end + planning.smoothing.total
    # Very long motions are checked more coarsely rather than for minutes.
    t = np.arange(start, end, max(planning.check, (end - start) / _MOST_CHECKS))
    filtered = law.filtered(t, planning.smoothing)
    v, a, j = filtered[:, 1:, None].transpose(1, 0, 2)
    _, d1, d2, d3 = curve.derivatives(np.ascontiguousarray(filtered[:, 0]))
    limits = here.joints[np.minimum(np.searchsorted(here.s, filtered[:, 0]), here.s.size - 1)]
    motion = np.stack([d1 * v, d1 * a + d2 * v * v, d1 * j + 3 * d2 * v * a + d3 * v * v * v], axis=1)
    out = (np.abs(motion) / limits).max(axis=2)
    first = here.joints.shape[2]
    _measure(here.s, here.speed, here.A[:, first:], here.B[:, first:], filtered, out)
    return t, out


def _lower(
    share: Array, here: PathConstraints, law: TimeLaw, planning: Planning, t: Array, ratios: Array, everywhere: bool
) -> None:
    """Lowers the shares wherever the filter saw what breaks a limit, and as far again before and after."""
    factor = np.ones_like(share)
    for k in np.flatnonzero(ratios.max(axis=1) > 1 + planning.slack):
        low, high = law.at(t[k] - planning.smoothing.total)[0], law.at(t[k])[0]
        first = max(int(np.searchsorted(here.s, 2 * low - high)) - 1, 0)
        window = slice(first, int(np.searchsorted(here.s, 2 * high - low, side="right")) + 1)
        # What cannot be mended, since it has begun, must not bring the rest to a standstill.
        velocity, acceleration, jerk = np.clip(ratios[k], 1.0, 1.5)
        factor[0, window] = np.minimum(factor[0, window], 1 / max(velocity, acceleration**0.5, jerk ** (1 / 3)))
        factor[1, window] = np.minimum(factor[1, window], 1 / max(acceleration, jerk ** (2 / 3)))
    share *= factor.min(axis=1, keepdims=True) if everywhere else factor


def _grid(curve: JointCurve, planning: Planning) -> tuple[Array, Array]:
    """Grid points, and which of them are the left side of a corner."""
    s: list[Array] = []
    left: list[Array] = []
    for a, b in zip(curve.s, curve.s[1:], strict=False):
        if b > a:
            n = max(planning.pieces, int(np.ceil((b - a) / planning.grid)))
            s.append(np.linspace(a, b, n + 1)[:-1])
            left.append(np.zeros(n, bool))
        else:
            s.append(np.array([a]))
            left.append(np.ones(1, bool))
    return np.append(np.concatenate(s), curve.end), np.append(np.concatenate(left), True)


def _tcp(s: Array, left: Array, q: Array, path: TaskPath | None, kinematics: Kinematics | None) -> tuple[Array, Array]:
    """(N, 6) each: first and second derivative of the TCP's motion by s."""
    if path is not None:
        sides = np.where(left, np.nextafter(s, -np.inf), s)
        states = [path.at(float(at)) for at in sides]
        return np.array([state.twist for state in states]), np.array([state.accel for state in states])
    if kinematics is None:
        raise ValueError("task limits on a joint path need the kinematics")
    first, second = np.empty((s.size, 6)), np.empty((s.size, 6))
    e = 1e-6
    for i in range(s.size):
        jacobian = kinematics.jacobian(q[0, i])
        ahead = kinematics.jacobian(q[0, i] + e * q[1, i])
        first[i] = jacobian @ q[1, i]
        second[i] = jacobian @ q[2, i] + (ahead - jacobian) @ q[1, i] / e
    return first, second


def _widened(array: Array, width: int) -> Array:
    return np.pad(array, ((0, 0), (0, width - array.shape[1])))


@compiled
def _measure(S: Array, speed: Array, A: Array, B: Array, law: Array, out: Array) -> None:
    """Raises ``out`` (k, 3) to what the filtered law (k, 4) uses of the TCP's limits, linear between grid points."""
    for m in range(law.shape[0]):
        s, v, a = law[m, 0], law[m, 1], law[m, 2]
        k = min(max(np.searchsorted(S, s, side="right"), 1), S.size - 1)
        h = S[k] - S[k - 1]
        w = min(max((s - S[k - 1]) / h, 0.0), 1.0) if h > 0 else 1.0
        out[m, 0] = max(out[m, 0], ((1 - w) * speed[k - 1] + w * speed[k]) * abs(v))
        for i in range(A.shape[1]):
            along = (1 - w) * A[k - 1, i] + w * A[k, i]
            across = (1 - w) * B[k - 1, i] + w * B[k, i]
            out[m, 1] = max(out[m, 1], abs(along * a + across * v * v))
