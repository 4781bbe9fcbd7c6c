from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.services.planner.planning.inflation import Inflation, inflation_cost

INFLATION = Inflation(0.23, 0.5, 4.0)


def test_ends_and_middle() -> None:
    assert inflation_cost(0.5, INFLATION) == inflation_cost(9.0, INFLATION) == 1.0
    assert inflation_cost(0.25, INFLATION) == pytest.approx(2.0)
    assert inflation_cost(0.0, INFLATION) == inflation_cost(-0.2, INFLATION) == 5.0


@given(st.floats(-1, 2), st.floats(-1, 2))
def test_less_clearance_never_costs_less(a: float, b: float) -> None:
    assert inflation_cost(min(a, b), INFLATION) >= inflation_cost(max(a, b), INFLATION)
