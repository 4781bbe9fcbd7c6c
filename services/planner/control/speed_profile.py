"""Commands that never change faster than the limits allow, and accelerations that build up."""

from __future__ import annotations

import math

from rackhand.runtime.compiled import inlined
from rackhand.schemas.base import Twist2
from rackhand.services.planner.settings import Limits

SLACK = 0.03  # m/s by which a speed may be more than the wanted one for the sake of its jerk


@inlined
def ramp(current: float, wanted: float, rise: float, fall: float) -> float:
    """``current`` moved towards ``wanted``: its magnitude grows by at most ``rise`` or shrinks by at most ``fall``.

    A change of sign ends at 0 first.
    """
    if current * wanted < 0.0:
        wanted = 0.0
    step = rise if abs(wanted) > abs(current) else fall
    return current + max(-step, min(step, wanted - current))


def limited(current: Twist2, linear: float, angular: float, dt: float, limits: Limits) -> Twist2:
    """The twist to command after ``current``, ``dt`` seconds later, towards the wanted one."""
    linear = min(max(linear, limits.max_backward_velocity), limits.max_forward_velocity)
    angular = min(max(angular, -limits.max_angular_velocity), limits.max_angular_velocity)
    turn = limits.max_angular_acc * dt
    return Twist2(
        linear=ramp(current.linear, linear, limits.max_forward_acc * dt, -limits.max_forward_decel * dt),
        angular=current.angular + min(max(angular - current.angular, -turn), turn),
    )


def smoothed(
    current: Twist2, linear: float, angular: float, dt: float, limits: Limits, acceleration: float, build_up: float
) -> Twist2:
    """As ``limited``, with a jerk that builds up the whole acceleration in ``build_up`` seconds.

    Slowing down builds up likewise as long as the speed is no more than ``SLACK`` beyond the wanted one, as on the way
    to a foreseen stop; a speed that must fall faster falls at once. ``acceleration``: of the last command, m/s². A
    turning rate has no such limit: what steers must not lag.
    """
    then = limited(current, linear, angular, dt, limits)
    if build_up <= dt:
        return then
    direction = math.copysign(1.0, current.linear if current.linear != 0.0 else then.linear)
    wanted = min(max(linear, limits.max_backward_velocity), limits.max_forward_velocity)
    speed, wanted, last = direction * current.linear, max(direction * wanted, 0.0), direction * acceleration
    if wanted >= speed:
        speed = _faster(speed, wanted, last, limits, dt, build_up)
    else:
        speed = _slower(speed, wanted, last, -limits.max_forward_decel, dt, build_up)
    return Twist2(linear=direction * max(speed, 0.0), angular=then.angular)


def _faster(speed: float, wanted: float, last: float, limits: Limits, dt: float, build_up: float) -> float:
    most = limits.max_forward_acc
    last = min(max(last, 0.0), most)  # braking ends at once
    change = min(_ending(wanted - speed, most / build_up, dt), most, last + most / build_up * dt)
    return min(speed + change * dt, wanted)


def _slower(speed: float, wanted: float, last: float, hardest: float, dt: float, build_up: float) -> float:
    jerk = hardest / build_up
    change = min(max(-min(_ending(speed - wanted, jerk, dt), hardest), last - jerk * dt), last + jerk * dt)
    smooth = max(speed + max(change, -hardest) * dt, wanted)
    return min(smooth, max(speed - hardest * dt, wanted + SLACK))


def _ending(gap: float, jerk: float, dt: float) -> float:
    """The acceleration that falls to 0 by ``jerk`` when the speed has changed by ``gap`` m/s.

    From the sum of an acceleration that falls by one step of jerk at a time, a (a + j dt) / 2 j = gap.
    """
    return 0.5 * (math.sqrt((jerk * dt) ** 2 + 8.0 * jerk * gap) - jerk * dt)


def braked(current: Twist2, dt: float, limits: Limits) -> Twist2:
    """The next twist of the shortest stop. The turning rate falls with the speed, so that the arc is kept."""
    linear = ramp(current.linear, 0.0, 0.0, -limits.max_forward_decel * dt)
    turn = limits.max_angular_acc * dt
    kept = current.angular * (linear / current.linear) if abs(current.linear) > 1e-9 else 0.0
    angular = current.angular + min(max(kept - current.angular, -turn), turn)
    return Twist2(linear=linear, angular=angular)
