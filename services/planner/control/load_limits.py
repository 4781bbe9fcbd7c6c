"""How fast a chassis may change its speed with a rack on its jack.

A rack is held by friction alone. It slides when it is accelerated by more than µ·g, and tips over the plate's edge when
by more than g·b/h (b: half the plate's length or width, h: height of the load's centre of mass above the plate). A load
high above the wheels also moves weight from the driven wheels onto the casters when it brakes: beyond
g / (1/µ + h/c) (c: distance of the casters from the axle) the wheels skid, and a stop is longer than it was foreseen.
For 300 kg on ``longjack``, goods on the top board (h = 1.05 m), these are 4.9, 2.3 and 2.2 m/s² in physics.

``benchmarks/carrying.py`` drives a course within these limits and measures the slide.
"""

from __future__ import annotations

from rackhand.services.planner.settings import Limits

# With the greatest load of the jack: half of what physics allows.
FULL_ACC = 0.4  # m/s²
FULL_DECEL = 1.2  # m/s², also of a stop that protects the chassis
FULL_ANGULAR_ACC = 1.0  # rad/s²


def load_limits(own: Limits, load: float) -> Limits:
    """What a chassis that can do ``own`` may do with a load: the share (0 to 1) of the greatest load of its jack.

    Accelerations and decelerations fall linearly with the load and are never raised; velocities stay. They hold for a
    stop before an obstacle too: a longer stop is foreseen, a rack that falls is not.
    """
    share = min(max(load, 0.0), 1.0)
    return own._replace(
        max_forward_acc=_lowered(own.max_forward_acc, FULL_ACC, share),
        max_forward_decel=-_lowered(-own.max_forward_decel, FULL_DECEL, share),
        max_angular_acc=_lowered(own.max_angular_acc, FULL_ANGULAR_ACC, share),
    )


def _lowered(empty: float, full: float, share: float) -> float:
    return empty - share * max(empty - full, 0.0)
