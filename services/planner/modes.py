"""Control modes, stops and remote driving of one chassis."""

from __future__ import annotations

from dataclasses import dataclass

from rackhand.schemas.base import NANOSECONDS, Twist2
from rackhand.schemas.chassis import ControlMode
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.geometry.se2 import STANDSTILL


@dataclass(frozen=True)
class RemoteLimits:
    """Remote driving: speeds in m/s and rad/s, accelerations in m/s² and rad/s², life of one twist in ns."""

    max_forward_velocity: float = 0.8
    max_backward_velocity: float = 0.2
    max_angular_velocity: float = 1.2
    max_acceleration: float = 0.5
    max_deceleration: float = 2.0
    max_angular_acceleration: float = 2.0
    twist_life_ns: int = NANOSECONDS // 2


class Modes:
    """Who may drive: moves in ``auto``, remote twists in ``remote``, nobody in ``manual`` or in an emergency stop.

    There are two stops, one asked for and one pressed; either holds.
    """

    def __init__(self, limits: RemoteLimits | None = None) -> None:
        self.limits = limits or RemoteLimits()
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
        """Follow this twist from ``stamp`` on, within the limits. Raises ``RequestRefused`` (precondition)."""
        if self.control_mode != "remote":
            raise RequestRefused(
                RefusalCode.PRECONDITION, f"control mode is {self.control_mode}; remote driving needs remote"
            )
        if self.emergency_stop:
            raise RequestRefused(RefusalCode.PRECONDITION, "the emergency stop is on")
        limits = self.limits
        within = Twist2(
            linear=min(max(twist.linear, -limits.max_backward_velocity), limits.max_forward_velocity),
            angular=min(max(twist.angular, -limits.max_angular_velocity), limits.max_angular_velocity),
        )
        self._remote = within, stamp

    def forget_remote_twist(self) -> None:
        self._remote = None

    def remote_twist(self, stamp: int) -> Twist2:
        """What remote driving wants at ``stamp``: the last twist while it lives, else standstill."""
        if self._remote is None or not 0 <= stamp - self._remote[1] < self.limits.twist_life_ns:
            return STANDSTILL
        return self._remote[0]


def ramp(now: Twist2, wanted: Twist2, limits: RemoteLimits, seconds: float) -> Twist2:
    """The twist nearest to ``wanted`` that is within reach of ``now`` in this time."""
    slowing = abs(wanted.linear) < abs(now.linear) or wanted.linear * now.linear < 0
    step = (limits.max_deceleration if slowing else limits.max_acceleration) * seconds
    turn = limits.max_angular_acceleration * seconds
    return Twist2(
        linear=now.linear + min(max(wanted.linear - now.linear, -step), step),
        angular=now.angular + min(max(wanted.angular - now.angular, -turn), turn),
    )
