"""The charge of a battery: what driving, standing and lifting take from it, and what a charger gives."""

from __future__ import annotations

from rackhand.schemas.chassis import Battery
from rackhand.worlds.chassis_model import BatteryKind

SECONDS_PER_HOUR = 3600.0


class BatteryModel:
    """Energy in W·s. Full and empty are hard ends; the voltage is linear in the charge."""

    def __init__(self, kind: BatteryKind, percentage: float) -> None:
        self.kind = kind
        self._capacity = kind.capacity * SECONDS_PER_HOUR
        self._energy = percentage * self._capacity
        self._power = kind.idle

    @property
    def percentage(self) -> float:
        return self._energy / self._capacity

    def set_percentage(self, percentage: float) -> None:
        self._energy = percentage * self._capacity

    def draw(self, speed: float, jacking: bool, charging: bool, dt: float) -> None:
        """Let ``dt`` seconds pass at this speed (m/s)."""
        kind = self.kind
        self._power = kind.idle + kind.per_speed * abs(speed) + kind.jacking * jacking - kind.charging * charging
        self._energy = min(self._capacity, max(0.0, self._energy - self._power * dt))

    def report(self, stamp: int, charging: bool) -> Battery:
        """Amperes are negative while more comes in than goes out."""
        voltage = self.kind.voltage_empty + self.percentage * (self.kind.voltage_full - self.kind.voltage_empty)
        return Battery(
            stamp=stamp,
            percentage=self.percentage,
            voltage=voltage,
            current=self._power / voltage,
            charging=charging,
        )
