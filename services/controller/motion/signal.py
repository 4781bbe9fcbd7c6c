"""A velocity or torque that a client holds: the reference of ``setVelocity`` and ``setTorque``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from rackhand.schemas.arrays import Array


@dataclass(frozen=True)
class SignalReference:
    """``values``: joints (n,) [rad/s, N·m], or a twist or wrench (6,) at the tool in base axes, linear part first."""

    signal: Literal["velocity", "torque"]
    space: Literal["joints", "task"]
    values: Array

    def same_kind(self, other: SignalReference) -> bool:
        """Whether one may replace the other without a stop between them."""
        return (self.signal, self.space) == (other.signal, other.space)
