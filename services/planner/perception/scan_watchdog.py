"""Whether the scan is good enough to move on, and for how long it has not been."""

from __future__ import annotations

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.chassis import Scan
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed, elapsed
from rackhand.services.planner.perception.local_costmap import is_usable
from rackhand.services.planner.settings import NavigationSettings


class ScanWatchdog:
    """Remembers the last usable scan."""

    def __init__(self, settings: NavigationSettings) -> None:
        self._settings = settings
        self._scan_stamp = -1
        self._usable_stamp: int | None = None
        self._begun: int | None = None

    def take(self, stamp: int, scan: Scan | None) -> bool:
        """Whether ``scan`` is usable and new at ``stamp``. A clock that restarted is noticed."""
        if stamp < self._scan_stamp:
            self._scan_stamp, self._usable_stamp, self._begun = -1, None, None
        if scan is None or scan.stamp == self._scan_stamp:
            return False
        self._scan_stamp = scan.stamp
        if not is_usable(scan, self._settings.scan_min_valid_fraction):
            return False
        self._usable_stamp = scan.stamp
        return True

    def begin(self, stamp: int) -> None:
        """A move begins: a scan that never came counts as missing from now."""
        self._begun = stamp

    def fault(self, stamp: int) -> str | None:
        """Why the scan cannot be trusted now: it is too old, blind, or never came. None if it can."""
        if self._usable_stamp is None:
            return "no usable scan yet"
        age = (stamp - self._usable_stamp) / NANOSECONDS
        if age > self._settings.scan_timeout or self._scan_stamp > self._usable_stamp:
            return f"no usable scan for {age:.2f} s"
        return None

    def check(self, stamp: int) -> None:
        """Raises ``MoveFailed(CONTROL_COSTMAP_ERROR)`` if the scan has been missing for too long."""
        since = self._begun if self._usable_stamp is None else self._usable_stamp
        age = 0.0 if since is None else (stamp - since) / NANOSECONDS
        if age > self._settings.scan_timeout + self._settings.scan_fail_after:
            arrives = self._usable_stamp is not None and self._scan_stamp > self._usable_stamp
            few = f"scans arrive, with less than {self._settings.scan_min_valid_fraction:.0%} of their ranges measured"
            text = f"no usable scan for {age:.1f} s: {few if arrives else 'the driver publishes none'}"
            most = self._settings.scan_timeout + self._settings.scan_fail_after
            missing = elapsed("time without a usable scan", age, round(most, 2))
            raise MoveFailed(MoveFailReason.CONTROL_COSTMAP_ERROR, text).about(measures=(missing,))
