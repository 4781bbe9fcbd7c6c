"""Inverse kinematics along a task path: one continuous q(s), or a refusal with the place where it ends.

The curve solves q' = J⁺x' + (I − J⁺J) g, knot by knot: a Taylor step, a Newton correction onto the path, and a check
of the Hermite piece between them. Steps shrink until the piece fits, so a posture is only ever left continuously;
where no step is short enough, the arm would have to jump or cannot reach on, and the path is refused.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.curve import JointCurve
from rackhand.services.controller.trajectory.geometry import TaskPath, TaskState, rotation_log
from rackhand.services.controller.trajectory.model import JointLimits, Kinematics, PathRefused, Placement


@dataclass(frozen=True)
class Continuation:
    """How exactly the path is followed. ``position`` (m) and ``angle`` (rad) bound the error between knots.

    ``joint_step`` (rad) bounds the motion between knots; ``damping`` the gain J⁺ can have (1/(2·damping), per metre).
    ``repulsion`` (rad per metre) drives redundant arms away from the position limits, from ``inner`` of the range on.
    """

    position: float = 2e-5
    angle: float = 1e-4
    residual: float = 1e-9
    joint_step: float = 0.2
    longest: float = 0.05
    shortest: float = 1e-6
    damping: float = 1e-5
    repulsion: float = 4.0
    inner: float = 0.8


@dataclass(frozen=True)
class _Knot:
    s: float
    q: Array
    dq: Array
    ddq: Array


@dataclass(frozen=True)
class _Follower:
    """The arm on the path, and the differential equation it follows."""

    kinematics: Kinematics
    limits: JointLimits
    path: TaskPath
    options: Continuation

    def slope(self, q: Array, twist: Array) -> Array:
        """q' at ``q`` for the path's twist."""
        jacobian = self.kinematics.jacobian(q)
        centre, half = (self.limits.upper + self.limits.lower) / 2, (self.limits.upper - self.limits.lower) / 2
        beyond = np.maximum(np.abs(q - centre) / half - self.options.inner, 0.0) / (1 - self.options.inner)
        away = -np.sign(q - centre) * self.options.repulsion * beyond**2
        return away + self._inverse(jacobian, twist - jacobian @ away)

    def knot(self, s: float, q: Array, state: TaskState) -> _Knot:
        dq = self.slope(q, state.twist)
        # Small against how fast q' itself turns, or the difference would miss it near singularities.
        e = 1e-5 / max(1.0, float(np.abs(dq).max()))
        ahead = self.slope(q + e * dq, state.twist + e * state.accel)
        behind = self.slope(q - e * dq, state.twist - e * state.accel)
        return _Knot(s, q, dq, (ahead - behind) / (2 * e))

    def corrected(self, q: Array, target: Placement) -> tuple[Array, float]:
        """``q`` moved onto ``target`` by damped Newton steps, and the largest component of the error that is left."""
        for _ in range(6):
            error = pose_error(self.kinematics.forward(q), target)
            if np.abs(error).max() < self.options.residual:
                break
            q = q + self._inverse(self.kinematics.jacobian(q), error)
        error = pose_error(self.kinematics.forward(q), target)
        return q, float(np.abs(error).max())

    def step(self, knot: _Knot, s: float) -> _Knot | None:
        """The knot at ``s``, or None if the piece from ``knot`` to it does not follow the path."""
        h = s - knot.s
        state = self.path.at(s)
        guess = knot.q + h * (knot.dq + 0.5 * h * knot.ddq)
        # The Taylor step is only worth something as long as it stays in the neighbourhood.
        if np.abs(guess - knot.q).max() > 1.5 * self.options.joint_step:
            return None
        q, left = self.corrected(guess, state.pose)
        if left > 100 * self.options.residual or np.abs(q - knot.q).max() > self.options.joint_step:
            return None
        new = self.knot(s, q, state)
        piece = JointCurve(*(np.array(pair) for pair in zip(_row(knot), _row(new), strict=True)))
        middle = np.array([knot.s + 0.25 * h, knot.s + 0.5 * h, knot.s + 0.75 * h])
        for at, between in zip(middle, piece.derivatives(middle)[0], strict=True):
            error = np.abs(pose_error(self.kinematics.forward(between), self.path.at(at).pose))
            if error[:3].max() > self.options.position or error[3:].max() > self.options.angle:
                return None
        return new

    def _inverse(self, jacobian: Array, vector: Array) -> Array:
        gram = jacobian @ jacobian.T
        gram[np.diag_indices(6)] += self.options.damping**2
        return np.asarray(jacobian.T @ np.linalg.solve(gram, vector))


def follow(
    kinematics: Kinematics,
    limits: JointLimits,
    path: TaskPath,
    q: Array,
    start: float | None = None,
    first: int = 0,
    options: Continuation | None = None,
) -> JointCurve:
    """q(s) of ``path`` from ``start`` (default: its beginning) where the arm is at ``q`` (n,).

    ``first`` is the number the caller gives the waypoint after the path's first. Raises ``PathRefused`` if ``q`` is
    not on the path, or if anywhere the arm cannot reach, would have to jump, or would leave its position limits.
    """
    options = options or Continuation()
    follower = _Follower(kinematics, limits, path, options)
    s = float(path.legs.s[0]) if start is None else start
    stops = [at for at in path.breaks() if at > s + options.shortest]
    corners = path.legs.s[path.legs.stop]
    q, left = follower.corrected(q, path.at(s).pose)
    if left > 1e3 * options.residual:
        raise PathRefused(first, f"the arm is not at the start of the path: {left:.2g} m or rad away")
    knots = [follower.knot(s, q, path.at(s))]
    step = options.longest
    for stop in stops:
        while knots[-1].s < stop:
            step = _advance(follower, knots, stop, step, first)
        if (corners == stop).any():
            # The next leg's derivatives, at the same place.
            beyond = path.at(np.nextafter(stop, np.inf))
            knots.append(follower.knot(stop, knots[-1].q, beyond))
    columns = zip(*(_row(knot) for knot in knots), strict=True)
    return JointCurve(*(np.array(column) for column in columns))


def pose_error(actual: Placement, target: Placement) -> Array:
    """(6,) position and rotation vector, base axes, that lead from ``actual`` to ``target``."""
    turn = target.rotation @ actual.rotation.T
    return np.concatenate([target.translation - actual.translation, rotation_log(turn)])


def _advance(follower: _Follower, knots: list[_Knot], stop: float, step: float, first: int) -> float:
    """Adds the next knot towards ``stop``; the step to try after it."""
    here = knots[-1]
    while True:
        remaining = stop - here.s
        # Two halves rather than a long step and a sliver.
        s = stop if step >= remaining else here.s + min(step, remaining / 2)
        new = follower.step(here, s)
        if new is not None:
            outside = follower.limits.outside(new.q)
            if outside is not None:
                raise PathRefused(_point(follower, s, first), f"on the path before this point, {outside}")
            knots.append(new)
            return min(follower.options.longest, 1.6 * (s - here.s) if s < stop else max(step, 1.6 * (s - here.s)))
        step = (s - here.s) / 2
        if step < follower.options.shortest:
            raise PathRefused(_point(follower, s, first), _why(follower, here))


def _why(follower: _Follower, here: _Knot) -> str:
    """Tries the next millimetre at any price, to say by how much it fails."""
    legs = follower.path.legs
    ahead = min(here.s + 1e-3, float(legs.s[-1]))
    target = follower.path.at(ahead).pose
    q, _ = follower.corrected(here.q, target)
    error = pose_error(follower.kinematics.forward(q), target)
    corner = min(int(np.searchsorted(legs.s, here.s, side="right")), legs.s.size - 1)
    to_go = float(legs.s[corner] - here.s)
    size, angle = float(np.linalg.norm(error[:3])), float(np.degrees(np.linalg.norm(error[3:])))
    if size < 1e-6 and angle < 1e-3:
        jump = float(np.abs(q - here.q).max())
        return f"{to_go:.4f} m before this point the joints would have to jump by {jump:.2f} rad"
    return f"out of reach: {to_go:.4f} m before this point the tool deviates by {size * 1e3:.2f} mm and {angle:.2f}°"


def _point(follower: _Follower, s: float, first: int) -> int:
    """The caller's number of the waypoint that follows ``s``."""
    s_points = follower.path.legs.s
    return max(0, first + min(int(np.searchsorted(s_points, s - 1e-12)), s_points.size - 1) - 1)


def _row(knot: _Knot) -> tuple[float, Array, Array, Array]:
    return knot.s, knot.q, knot.dq, knot.ddq
