from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import Scan
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.perception.chassis_state import Observation
from rackhand.services.planner.perception.scan_watchdog import ScanWatchdog
from rackhand.services.planner.settings import NavigationSettings

S = NavigationSettings()
SECOND = 10**9
HERE = Pose2(x=0.0, y=0.0, yaw=0.0)


def scan(stamp: int, blind: bool = False) -> Scan:
    ranges = np.full(90, math.nan if blind else 3.0, dtype="<f4")
    return Scan(stamp=stamp, sensor=HERE, angle_min=0.0, angle_step=0.07, range_max=10.0, ranges=ranges)


def seen(stamp: int, newest: Scan | None, pose_stamp: int | None = None) -> Observation:
    at = stamp if pose_stamp is None else pose_stamp
    return Observation(stamp, HERE, at, HERE, Twist2(linear=0.0, angular=0.0), newest)


def test_each_usable_scan_is_new_once() -> None:
    watchdog, one = ScanWatchdog(S), scan(0)
    assert not watchdog.is_new_scan(seen(0, None))
    assert watchdog.is_new_scan(seen(0, one)) and not watchdog.is_new_scan(seen(1, one))
    assert not watchdog.is_new_scan(seen(2, scan(2, blind=True)))
    assert watchdog.is_new_scan(seen(3, scan(3)))


def test_a_clock_that_starts_again_makes_scans_new_again() -> None:
    watchdog = ScanWatchdog(S)
    watchdog.is_new_scan(seen(5 * SECOND, scan(5 * SECOND)))
    assert watchdog.is_new_scan(seen(0, scan(0)))


def test_no_trouble_while_scans_and_poses_come() -> None:
    watchdog, newest = ScanWatchdog(S), scan(0)
    watchdog.is_new_scan(seen(0, newest))
    assert watchdog.trouble(seen(int(S.scan_timeout * SECOND), newest)) is None
    assert "no usable scan" in (watchdog.trouble(seen(int((S.scan_timeout + 0.1) * SECOND), newest)) or "")


def test_a_blind_scan_is_trouble_at_once() -> None:
    watchdog, blind = ScanWatchdog(S), scan(SECOND // 10, blind=True)
    watchdog.is_new_scan(seen(0, scan(0)))
    watchdog.is_new_scan(seen(SECOND // 10, blind))
    assert watchdog.trouble(seen(SECOND // 10, blind)) == "no usable scan for 0.10 s"


def test_an_old_pose_is_trouble() -> None:
    watchdog, newest = ScanWatchdog(S), scan(SECOND)
    watchdog.is_new_scan(seen(SECOND, newest))
    assert watchdog.trouble(seen(SECOND, newest, pose_stamp=0)) == "the pose is 1.00 s old"


def test_a_scan_that_stays_out_fails_the_move_also_one_that_never_came() -> None:
    watchdog = ScanWatchdog(S)
    watchdog.begin(SECOND)
    end = SECOND + int((S.scan_timeout + S.scan_fail_after) * SECOND)
    assert watchdog.trouble(seen(end, None)) is not None
    with pytest.raises(MoveFailed) as failed:
        watchdog.trouble(seen(end + SECOND // 10, None))
    assert failed.value.reason is MoveFailReason.CONTROL_COSTMAP_ERROR
    assert failed.value.text == "no usable scan for 6.1 s"
