"""The costs of an MPPI rollout, one function each; ``MppiCosts`` in the settings has their units and weights."""

from __future__ import annotations

import math

from rackhand.runtime.compiled import inlined
from rackhand.services.planner.settings import MppiCosts


@inlined
def collision_weight(t: int, steps: int, costs: MppiCosts) -> float:
    """What a collision in step ``t`` of ``steps`` costs: less the later, since predictions are less certain."""
    return costs.collision * (1.0 - costs.late_discount * t / steps)


@inlined
def static_cost(clearance: float, dt: float, weight: float, costs: MppiCosts) -> float:
    """Cost of ``dt`` seconds with this clearance (m) to blocked cells; ``weight``: that of a collision."""
    if clearance < 0.0:
        return weight
    if clearance >= costs.static_range:
        return 0.0
    return costs.static_proximity * dt * math.exp(-clearance / costs.static_scale)


@inlined
def dynamic_cost(clearance: float, dt: float, weight: float, costs: MppiCosts) -> float:
    """Cost of ``dt`` seconds with this clearance (m) to a dynamic obstacle; ``weight``: that of a collision, which
    grows with the depth, so that a rollout in it still finds the nearest side."""
    if clearance < 0.0:
        return weight * (1.0 - clearance)
    return costs.dynamic_proximity * dt * math.exp(-clearance / costs.dynamic_scale)


@inlined
def effort_cost(v: float, w: float, dt: float, costs: MppiCosts) -> float:
    """Cost of ``dt`` seconds at this speed (m/s) and turning rate (rad/s)."""
    return costs.effort * dt * (w * w + costs.effort_linear * v * v)


@inlined
def backward_cost(v: float, dt: float, costs: MppiCosts) -> float:
    """Cost of the metres driven backward in ``dt`` seconds."""
    return -costs.backward * v * dt if v < 0.0 else 0.0


@inlined
def goal_cost(to_go: float, away: float, costs: MppiCosts) -> float:
    """Cost of what is left at the end: the cost to go, or where that is not known the distance (m) and more."""
    return to_go if math.isfinite(to_go) else costs.off_field + away


@inlined
def heading_cost(error: float, away: float, costs: MppiCosts) -> float:
    """Cost of the angle (rad) to the goal's heading at the end, ``away`` metres from the goal."""
    if away >= costs.heading_range:
        return 0.0
    return costs.heading * abs(error) * (1.0 - away / costs.heading_range)
