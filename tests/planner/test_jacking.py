"""Orders of the jack that cannot be carried out."""

from __future__ import annotations

from rackhand.schemas.chassis import Jack
from rackhand.services.planner.jacking import JackOrders


def jack(progress: float, stalled: bool = False) -> Jack:
    return Jack(stamp=0, state="hold", progress=progress, weight=345.2, stalled=stalled)


def test_a_stalled_jack_ends_the_order_and_says_under_what() -> None:
    orders = JackOrders()
    orders.request("up", jack(0.0))
    assert orders.command(jack(0.3), 0, allowed=True) == "up" and orders.failed is None
    assert orders.command(jack(0.46, stalled=True), 40_000_000, allowed=True) == "hold"
    assert orders.active is None
    assert orders.failed == "the jack stalled at 46% of its stroke under 345 kg: too heavy"
    orders.request("down", jack(0.46))
    assert orders.command(jack(0.46), 80_000_000, allowed=True) == "down" and orders.failed is None
