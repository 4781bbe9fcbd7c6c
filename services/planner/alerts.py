"""The rows of ``/alerts``. Codes are component·1000 + n; hundreds 0-4 are errors, 5-9 warnings."""

from __future__ import annotations

from rackhand.schemas.chassis import Alert
from rackhand.services.planner.jacking import JackOrders
from rackhand.services.planner.load import Slip
from rackhand.services.planner.perception.chassis_state import QUALITY_LOST, ChassisState

STUCK = 1007
MAP_INFO_BAD = 1009
NO_POSITION_DURING_MOVE = 1013
POSITION_UNRELIABLE = 7002
POSITION_LOST = 7005
BATTERY_CRITICAL = 8003
BATTERY_LOW = 8501
RACK_MOVED_SLIGHTLY = 9015
JACK_ERROR = 9016
JACK_SELF_CHECK = 12004
RACK_MOVED_FAR = 12005

LOW_CHARGE, CRITICAL_CHARGE = 0.2, 0.1
POOR_QUALITY = 3


def active_alerts(
    sensed: ChassisState,
    jack: JackOrders,
    *,
    moving: bool,
    stuck: bool,
    map_trouble: str | None,
    slipped: Slip = Slip.NONE,
) -> tuple[Alert, ...]:
    """All that is the matter now, in the order of their codes."""
    found: list[Alert] = []
    if stuck:
        found.append(_alert(STUCK, "the robot is stuck while moving"))
    if map_trouble is not None:
        found.append(_alert(MAP_INFO_BAD, map_trouble))
    found += _position(sensed, moving)
    found += _battery(sensed)
    if jack.failed is not None:
        found.append(_alert(JACK_SELF_CHECK if jack.check_state == "error" else JACK_ERROR, jack.failed))
    text = f"the rack has moved {slipped.value} on the jack since it was lifted"
    if slipped is Slip.SLIGHTLY:
        # A warning by what it means, though not by its code, which is that of the real robot.
        found.append(Alert(code=RACK_MOVED_SLIGHTLY, level="warning", msg=text))
    elif slipped is Slip.SIGNIFICANTLY:
        found.append(_alert(RACK_MOVED_FAR, text))
    return tuple(sorted(found, key=lambda alert: alert.code))


def _position(sensed: ChassisState, moving: bool) -> list[Alert]:
    if sensed.odometry is None:
        return []
    if sensed.pose_trouble() is not None:  # whose text has an age in it; a row does not change while it is active
        during = [_alert(NO_POSITION_DURING_MOVE, "no position during a move")] if moving else []
        return [*during, _alert(POSITION_LOST, "the position is lost")]
    if sensed.pose is not None and QUALITY_LOST < sensed.pose.quality <= POOR_QUALITY:
        return [_alert(POSITION_UNRELIABLE, "the position is unreliable")]
    return []


def _battery(sensed: ChassisState) -> list[Alert]:
    if sensed.battery is None or sensed.battery.charging or sensed.battery.percentage >= LOW_CHARGE:
        return []
    if sensed.battery.percentage < CRITICAL_CHARGE:
        return [_alert(BATTERY_CRITICAL, f"the battery is critically low, under {CRITICAL_CHARGE:.0%}")]
    return [_alert(BATTERY_LOW, f"the battery is low, under {LOW_CHARGE:.0%}")]


def _alert(code: int, msg: str) -> Alert:
    return Alert(code=code, level="error" if code // 100 % 10 < 5 else "warning", msg=msg)
