"""Driving straight along the axis of the chassis, as out of a dock or a doorway: how far it is free."""

from __future__ import annotations

import math

import numpy as np

from rackhand.services.planner.behaviors.base import Array, Context
from rackhand.services.planner.geometry import se2

BESIDE = 0.03  # m beside the body that must be free on the way


def straight_free(ctx: Context, direction: int, may_touch: tuple[Array, ...] = ()) -> float:
    """Metres straight ahead (1) or back (-1) without an obstacle, for the body; infinite for all in view.

    ``may_touch`` as in ``Drive``.
    """
    rows = ctx.costmap.obstacles(ctx.pose, may_touch)
    points = se2.transformed(se2.between(ctx.pose, np.zeros(3)), rows[:, :2])
    body = ctx.footprint.polygon
    beside = (points[:, 1] < body[:, 1].max() + BESIDE) & (points[:, 1] > body[:, 1].min() - BESIDE)
    end = float((direction * body[:, 0]).max())
    along = direction * points[beside, 0] - end
    return float(along[along > -end].min(initial=math.inf))
