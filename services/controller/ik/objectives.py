"""Objective functions: what the arm does with the freedom that the task leaves. CRF's names and parameters.

Each is a cost over q, and asks for the joint velocity -∂cost/∂q [rad/s]. All can be switched, blended in and tuned
while the arm moves: the sum is limited in speed, and the tick limits acceleration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik.arm import Arm
from rackhand.services.controller.ik.collision import add_derivative, place
from rackhand.services.controller.ik.kernels import forward, jacobian, posture_velocity


class ObjectiveError(ValueError):
    """A parameter that is not valid: the text says which, of what, and what was expected."""


@dataclass
class DesiredJointPositions:
    """Moves towards a posture; NaN leaves a joint free. c [1/s]."""

    arm: Arm
    c: float = 1.0
    attraction: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not len(self.attraction):
            self.attraction = np.full(self.arm.n, np.nan)

    def cost(self, q: Array) -> float:
        """½ c |q - attraction|² over the joints that have an attraction."""
        return 0.5 * self.c * float(np.nansum((q - self.attraction) ** 2))

    def velocity(self, q: Array) -> Array:
        """-∂cost/∂q."""
        velocity: Array = posture_velocity(q, self.attraction, self.c)
        return velocity


@dataclass
class JointLimitAvoidance:
    """Keeps clear of the position limits: p (e^{-c(q-lower)} + e^{c(q-upper)}). c [1/rad], p [rad²/s]."""

    arm: Arm
    c: float = 20.0
    p: float = 0.05

    def _terms(self, q: Array) -> tuple[Array, Array]:
        limits = self.arm.limits
        low, high = -self.c * (q - limits.lower), self.c * (q - limits.upper)
        return np.exp(np.minimum(low, 50.0)), np.exp(np.minimum(high, 50.0))

    def cost(self, q: Array) -> float:
        """See the class."""
        low, high = self._terms(q)
        return self.p * float(low.sum() + high.sum())

    def velocity(self, q: Array) -> Array:
        """-∂cost/∂q."""
        low, high = self._terms(q)
        return self.p * self.c * (low - high)


@dataclass
class ManipulabilityAscent:
    """Climbs √det(J Jᵀ) (Yoshikawa 1985), away from singularities. c [rad²/s for each unit of it]."""

    arm: Arm
    c: float = 10.0

    def cost(self, q: Array) -> float:
        """-c √det(J Jᵀ)."""
        jac = self._jacobian(q)
        return -self.c * math.sqrt(max(0.0, float(np.linalg.det(jac @ jac.T))))

    def velocity(self, q: Array) -> Array:
        """-∂cost/∂q = c m tr(J⁺ ∂J/∂q): in the tool's axes column i changes with a later joint k by the bracket [J_i,
        J_k]."""
        jac = self._jacobian(q)
        square = jac @ jac.T + 1e-12 * np.eye(6)
        measure, pinv = math.sqrt(np.linalg.det(square)), np.linalg.solve(square, jac)
        linear, angular = jac[:3].T, jac[3:].T
        gradient = np.zeros(self.arm.n)
        for k in range(1, self.arm.n):
            moved = np.cross(angular[:k], linear[k]) + np.cross(linear[:k], angular[k])
            turned = np.cross(angular[:k], angular[k])
            gradient[k] = np.sum(pinv[:3, :k].T * moved) + np.sum(pinv[3:, :k].T * turned)
        return self.c * measure * gradient

    def _jacobian(self, q: Array) -> Array:
        frames, jac = np.empty((self.arm.n + 1, 3, 4)), np.empty((6, self.arm.n))
        forward(self.arm.placements, q, frames)
        jacobian(frames, jac)
        return jac


@dataclass
class CollisionAvoidanceSphere:
    """Pushes the links away from a sphere (base frame) once they are nearer than ``range``. c [1/s per m of gap], all
    m."""

    arm: Arm
    c: float = 20.0
    center: Array = field(default_factory=lambda: np.zeros(3))
    radius: float = 0.1
    range: float = 0.2

    def cost(self, q: Array) -> float:
        """½ c Σ depth² over the spheres of the links."""
        return 0.5 * self.c * sum(depth**2 for depth, _ in self._depths(q))

    def velocity(self, q: Array) -> Array:
        """-∂cost/∂q."""
        total = np.zeros(self.arm.n)
        for depth, away in self._depths(q):
            total += self.c * depth * away
        return total

    def _depths(self, q: Array) -> list[tuple[float, Array]]:
        """For each sphere nearer than ``range``: by how much [m], and the derivative of its distance by q."""
        frames = np.empty((self.arm.n + 1, 3, 4))
        forward(self.arm.placements, q, frames)
        found = []
        for sphere in self.arm.spheres:
            point = place(frames, sphere.joint, sphere.center)
            offset = np.array(point) - self.center
            distance = float(np.linalg.norm(offset))
            depth = self.range + self.radius + sphere.radius - distance
            if depth > 0.0 and distance > 1e-9 and sphere.joint >= 0:
                row = np.zeros(self.arm.n)
                x, y, z = (offset / distance).tolist()
                add_derivative(frames, sphere.joint, point, x, y, z, row)
                found.append((depth, row))
        return found


Objective = DesiredJointPositions | JointLimitAvoidance | ManipulabilityAscent | CollisionAvoidanceSphere
KINDS: dict[str, type[Objective]] = {
    "DesiredJointPositions": DesiredJointPositions,
    "JointLimits": JointLimitAvoidance,
    "Manipulability": ManipulabilityAscent,
    "CollisionAvoidanceSphere": CollisionAvoidanceSphere,
}
"""By their names in CRF."""


@dataclass
class _Entry:
    objective: Objective
    enabled: bool = False
    phase: float = 0.0  # 0 off … 1 fully on

    @property
    def share(self) -> float:
        """How far it is blended in: starts and ends smoothly."""
        return 0.5 - 0.5 * math.cos(math.pi * self.phase)


class Objectives:
    """The objective functions of one arm, each disabled at first, each blended in and out over ``blend_time`` [s]."""

    def __init__(self, arm: Arm, blend_time: float = 1.0) -> None:
        self.blend_time = blend_time
        self._entries = {name: _Entry(kind(arm)) for name, kind in KINDS.items()}
        self._active: list[_Entry] = []  # those whose share is not 0
        self._blending = False  # some share is changing

    def configure(self, name: str, parameters: Mapping[str, Any]) -> None:
        """Set parameters (the fields of the objective, and ``enable``) of one function, all or none.

        Raises ObjectiveError for an unknown name or parameter, or a value of the wrong shape or not finite."""
        if name not in self._entries:
            raise ObjectiveError(f"no objective function {name!r}: expected one of {', '.join(self._entries)}")
        entry = self._entries[name]
        known = {f.name for f in fields(entry.objective)} - {"arm"}
        accepted = {}
        for key, value in parameters.items():
            if key == "enable":
                if not isinstance(value, bool):
                    raise ObjectiveError(f"{name}.enable must be true or false, is {value!r}")
            elif key not in known:
                raise ObjectiveError(f"{name} has no parameter {key!r}: expected enable, {', '.join(sorted(known))}")
            else:
                accepted[key] = _checked(f"{name}.{key}", value, getattr(entry.objective, key), key == "attraction")
        for key, value in accepted.items():
            setattr(entry.objective, key, value)
        entry.enabled = parameters.get("enable", entry.enabled)
        self._blending = True

    def state(self) -> dict[str, float]:
        """How far each function is blended in, 0 … 1."""
        return {name: entry.share for name, entry in self._entries.items()}

    def advance(self, dt: float) -> bool:
        """Let ``dt`` [s] pass for the blends; whether any function is active."""
        if self._blending:
            change = dt / self.blend_time if self.blend_time > 0.0 else 1.0
            for entry in self._entries.values():
                entry.phase = min(1.0, max(0.0, entry.phase + (change if entry.enabled else -change)))
            self._active = [entry for entry in self._entries.values() if entry.phase > 0.0]
            self._blending = any(entry.phase != entry.enabled for entry in self._entries.values())
        return bool(self._active)

    def velocity(self, q: Array) -> Array:
        """The sum (n,) [rad/s] of the active functions' velocities."""
        total: Array | None = None
        for entry in self._active:
            part = entry.objective.velocity(q)
            if entry.phase < 1.0:
                part = entry.share * part
            total = part if total is None else total + part
        return np.zeros(len(q)) if total is None else total


def _checked(what: str, value: object, old: Any, may_be_nan: bool) -> Any:
    try:
        new = np.array(value, float)
    except (TypeError, ValueError):
        raise ObjectiveError(f"{what} must be of numbers, is {value!r}") from None
    if new.shape != np.shape(old) or np.any(np.isinf(new)) or (not may_be_nan and np.any(np.isnan(new))):
        raise ObjectiveError(f"{what} must be {np.shape(old) or 'one'} finite number(s), is {value!r}")
    if not np.shape(old):
        if new < 0:
            raise ObjectiveError(f"{what} must not be negative, is {value!r}")
        return float(new)
    return new
