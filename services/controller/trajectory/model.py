"""What trajectories are made of and for: poses, limits, what a kinematics has to offer, and refusals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from rackhand.schemas.arrays import Array

if TYPE_CHECKING:
    from rackhand.services.controller.trajectory.curve import JointCurve


class PathRefused(ValueError):
    """A path that cannot be driven, refused before anything moves.

    ``point`` is the index, in the call's own list, of the waypoint that fails, or of the end of the leg that fails.
    """

    def __init__(self, point: int, reason: str) -> None:
        super().__init__(f"waypoint {point}: {reason}")
        self.point = point
        self.reason = reason


class Placement(Protocol):
    """A pose of the TCP in the base frame; ``pinocchio.SE3`` is one."""

    @property
    def translation(self) -> Array: ...
    @property
    def rotation(self) -> Array: ...


@dataclass(frozen=True)
class TcpPose:
    """Position (3,) in metres and rotation matrix (3, 3), TCP in the base frame."""

    translation: Array
    rotation: Array

    def __matmul__(self, other: Placement) -> TcpPose:
        return TcpPose(self.translation + self.rotation @ other.translation, self.rotation @ other.rotation)


class Kinematics(Protocol):
    """What trajectories ask of an arm with n joints."""

    def forward(self, q: Array) -> Placement:
        """Pose of the TCP at ``q`` (n,)."""

    def jacobian(self, q: Array) -> Array:
        """(6, n): velocity of the TCP's origin and angular velocity, both in the axes of the base."""

    def solve(self, pose: Placement, q_near: Array) -> Array | None:
        """Joint positions within the limits that reach ``pose``, those near ``q_near`` first; if there are none, those
        with the TCP nearest to it that were found, or None."""


class PathCheck(Protocol):
    """What else may speak against a curve."""

    def conflict(self, curve: JointCurve, start: float) -> tuple[float, str] | None:
        """The place s from ``start`` on where the ``curve`` is first not allowed, and why; None if there is none."""


@dataclass(frozen=True)
class JointLimits:
    """All (n,): rad, rad/s, rad/s², rad/s³."""

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    jerk: Array

    def __post_init__(self) -> None:
        _require_positive(self, ("velocity", "acceleration", "jerk"), self.lower.size)
        if self.upper.shape != self.lower.shape or not (self.lower < self.upper).all():
            raise ValueError("lower position limits must be below the upper ones")

    def outside(self, q: Array) -> str | None:
        """Which joint is out of its position limits and by how much; None if none is."""
        excess = np.maximum(self.lower - q, q - self.upper)
        worst = int(np.argmax(excess))
        if excess[worst] <= 1e-9:
            return None
        bounds = f"[{self.lower[worst]:.4f}, {self.upper[worst]:.4f}]"
        return f"joint {worst} at {q[worst]:.4f} rad is {excess[worst]:.4f} rad outside {bounds}"


@dataclass(frozen=True)
class TaskLimits:
    """Linear xyz then angular xyz, base axes, all (6,): m/s and rad/s, m/s² and rad/s².

    The velocity limits of the linear and of the angular part are each the half axes of an ellipsoid: with equal
    numbers they bound the speed in any direction. Accelerations are bounded axis by axis.
    """

    velocity: Array
    acceleration: Array

    def __post_init__(self) -> None:
        _require_positive(self, ("velocity", "acceleration"), 6)


def _require_positive(limits: object, names: tuple[str, ...], size: int) -> None:
    for name in names:
        value = getattr(limits, name)
        if value.shape != (size,) or not (value > 0).all():
            raise ValueError(f"{name} limits must be {size} positive numbers, not {value}")
