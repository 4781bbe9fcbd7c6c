"""Whether what is measured is good enough to move on, and for how long it has not been."""

from __future__ import annotations

from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.perception.chassis_state import Observation
from rackhand.services.planner.perception.local_costmap import is_usable
from rackhand.services.planner.settings import NavigationSettings


class ScanWatchdog:
    """Remembers the last usable scan."""

    def __init__(self, settings: NavigationSettings) -> None:
        self._settings = settings
        self._scan_stamp = -1
        self._usable_stamp: int | None = None

    def is_new_scan(self, seen: Observation) -> bool:
        """Whether the observation holds a usable scan that was not taken yet. A clock that began anew is noticed."""
        if seen.stamp < self._scan_stamp:
            self._scan_stamp, self._usable_stamp = -1, None
        if seen.scan is None or seen.scan.stamp == self._scan_stamp:
            return False
        self._scan_stamp = seen.scan.stamp
        if not is_usable(seen.scan, self._settings.scan_min_valid_fraction):
            return False
        self._usable_stamp = seen.scan.stamp
        return True

    def begin(self, stamp: int) -> None:
        """A move begins: a scan that never came counts as missing from now."""
        if self._usable_stamp is None:
            self._usable_stamp = stamp

    def trouble(self, seen: Observation) -> str | None:
        """Why the chassis must not move now. Raises ``MoveFailed(CONTROL_COSTMAP_ERROR)`` if the scan stays out."""
        s = self._settings
        age = (seen.stamp - (self._usable_stamp or 0)) / NANOSECONDS
        if age > s.scan_timeout + s.scan_fail_after:
            raise MoveFailed(MoveFailReason.CONTROL_COSTMAP_ERROR, f"no usable scan for {age:.1f} s")
        blind = seen.scan is not None and seen.scan.stamp == self._scan_stamp != self._usable_stamp
        if age > s.scan_timeout or blind:
            return f"no usable scan for {age:.2f} s"
        old = (seen.stamp - seen.pose_stamp) / NANOSECONDS
        return f"the pose is {old:.2f} s old" if old > s.pose_timeout else None
