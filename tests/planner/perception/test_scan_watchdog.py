from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Scan
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.perception.scan_watchdog import ScanWatchdog
from rackhand.services.planner.settings import NavigationSettings

S = NavigationSettings()
SECOND = 10**9
HERE = Pose2(x=0.0, y=0.0, yaw=0.0)


def scan(stamp: int, blind: bool = False, reach: float = 3.0) -> Scan:
    ranges = np.full(90, math.nan if blind else reach, dtype="<f4")
    return Scan(stamp=stamp, sensor=HERE, angle_min=0.0, angle_step=0.07, range_max=10.0, ranges=ranges)


def test_each_usable_scan_is_new_once() -> None:
    watchdog, one = ScanWatchdog(S), scan(0)
    assert watchdog.fault(0) == "no usable scan yet"
    assert not watchdog.take(0, None)
    assert watchdog.take(0, one) and not watchdog.take(1, one)
    assert not watchdog.take(2, scan(2, blind=True))
    assert watchdog.take(3, scan(3)) and watchdog.fault(3) is None


def test_a_clock_that_starts_again_makes_scans_new_again() -> None:
    watchdog = ScanWatchdog(S)
    watchdog.take(5 * SECOND, scan(5 * SECOND))
    assert watchdog.take(0, scan(0))


def test_an_old_scan_is_a_fault_and_a_blind_one_at_once() -> None:
    watchdog = ScanWatchdog(S)
    watchdog.take(0, scan(0))
    assert watchdog.fault(int(S.scan_timeout * SECOND)) is None
    assert watchdog.fault(int((S.scan_timeout + 0.1) * SECOND)) == "no usable scan for 1.10 s"
    watchdog.take(SECOND // 10, scan(SECOND // 10, blind=True))
    assert watchdog.fault(SECOND // 10) == "no usable scan for 0.10 s"


def test_a_scan_that_stays_out_fails_the_move_also_one_that_never_came() -> None:
    watchdog = ScanWatchdog(S)
    watchdog.begin(SECOND)
    end = SECOND + int((S.scan_timeout + S.scan_fail_after) * SECOND)
    watchdog.check(end)
    with pytest.raises(MoveFailed) as failed:
        watchdog.check(end + SECOND // 10)
    assert failed.value.reason is MoveFailReason.CONTROL_COSTMAP_ERROR
    assert failed.value.text == "no usable scan for 6.1 s: the driver publishes none"


@pytest.mark.parametrize("returns", [0, 1, 3, 90])
def test_a_lidar_that_works_may_see_nothing_and_is_trusted(returns: int) -> None:
    watchdog, open_ground = ScanWatchdog(S), scan(0, reach=math.inf)
    ranges = open_ground.ranges.copy()
    ranges[:returns] = 3.0
    assert watchdog.take(0, open_ground.model_copy(update={"ranges": ranges}))
    assert watchdog.fault(0) is None


def test_a_lidar_with_hardly_a_measurement_is_blind() -> None:
    watchdog, covered = ScanWatchdog(S), scan(0, blind=True)
    ranges = covered.ranges.copy()
    ranges[:2], ranges[2:40] = math.inf, 0.0
    assert not watchdog.take(0, covered.model_copy(update={"ranges": ranges}))
    assert watchdog.fault(0) == "no usable scan yet"
