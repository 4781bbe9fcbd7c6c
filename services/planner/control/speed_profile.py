"""Commands that never change faster than the limits allow."""

from __future__ import annotations

from rackhand.runtime.compiled import inlined
from rackhand.schemas.base import Twist2
from rackhand.services.planner.settings import Limits


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


def braked(current: Twist2, dt: float, limits: Limits) -> Twist2:
    """The next twist of the shortest stop. The turning rate falls with the speed, so that the arc is kept."""
    linear = ramp(current.linear, 0.0, 0.0, -limits.max_forward_decel * dt)
    turn = limits.max_angular_acc * dt
    kept = current.angular * (linear / current.linear) if abs(current.linear) > 1e-9 else 0.0
    angular = current.angular + min(max(kept - current.angular, -turn), turn)
    return Twist2(linear=linear, angular=angular)
