"""Inflation: a metre costs more where the footprint has little clearance, so that plans keep away from obstacles."""

from __future__ import annotations

from typing import NamedTuple

from rackhand.runtime.compiled import inlined


class Inflation(NamedTuple):
    """``inscribed``: radius in metres that must be free. ``radius``: clearance beyond it, in metres, from which on a
    metre costs 1. ``weight``: what a metre costs more where the inscribed circle touches."""

    inscribed: float
    radius: float
    weight: float


@inlined
def inflation_cost(clearance: float, inflation: Inflation) -> float:
    """Cost of a metre with this clearance (metres) of the inscribed circle: between 1 and 1 + weight, quadratic."""
    if clearance >= inflation.radius:
        return 1.0
    lack = (inflation.radius - max(clearance, 0.0)) / inflation.radius
    return 1.0 + inflation.weight * lack * lack
