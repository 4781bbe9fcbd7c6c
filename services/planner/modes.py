"""Control modes, stops and remote driving of one chassis."""

from __future__ import annotations

from dataclasses import dataclass

from rackhand.schemas.base import NANOSECONDS, Twist2
from rackhand.schemas.chassis import ControlMode
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.settings import Limits

REMOTE_LIMITS = Limits(
    max_forward_velocity=0.8,
    max_backward_velocity=-0.2,
    max_forward_acc=0.5,
    max_forward_decel=-2.0,
    max_angular_velocity=1.2,
    max_angular_acc=2.0,
)


@dataclass(frozen=True)
class RemoteSettings:
    """Remote driving: its limits, and the life of one twist in ns."""

    limits: Limits = REMOTE_LIMITS
    twist_life_ns: int = NANOSECONDS // 2


class Modes:
    """Who may drive: moves in ``auto``, remote twists in ``remote``, nobody in ``manual`` or in an emergency stop.

    There are two stops, one asked for and one pressed; either holds.
    """

    def __init__(self, remote_twist_life_ns: int) -> None:
        self._twist_life_ns = remote_twist_life_ns
        self.control_mode: ControlMode = "auto"
        self.stop_requested = False
        self.stop_pressed = False
        self._remote: tuple[Twist2, int] | None = None

    @property
    def emergency_stop(self) -> bool:
        return self.stop_requested or self.stop_pressed

    def set_control_mode(self, mode: ControlMode) -> None:
        self.control_mode = mode
        self._remote = None

    def stop(self, *, requested: bool | None = None, pressed: bool | None = None) -> None:
        """Set or release one of the two stops. What remote driving wanted before a stop is forgotten."""
        self.stop_requested = self.stop_requested if requested is None else requested
        self.stop_pressed = self.stop_pressed if pressed is None else pressed
        if self.emergency_stop:
            self._remote = None

    def take_remote_twist(self, twist: Twist2, stamp: int) -> None:
        """Follow this twist from ``stamp`` on. Raises ``RequestRefused`` (precondition)."""
        if self.control_mode != "remote":
            raise RequestRefused(
                RefusalCode.PRECONDITION, f"the control mode is {self.control_mode}; remote driving needs mode remote"
            )
        if self.emergency_stop:
            raise RequestRefused(RefusalCode.PRECONDITION, "the emergency stop is on")
        self._remote = twist, stamp

    def forget_remote_twist(self) -> None:
        self._remote = None

    def remote_twist(self, stamp: int) -> Twist2:
        """What remote driving wants at ``stamp``: the last twist while it lives, else standstill."""
        if self._remote is None or not 0 <= stamp - self._remote[1] < self._twist_life_ns:
            return STANDSTILL
        return self._remote[0]
