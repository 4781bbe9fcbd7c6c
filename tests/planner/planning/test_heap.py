from __future__ import annotations

import heapq

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from rackhand.services.planner.planning.heap import grown, pop, push


@given(st.lists(st.none() | st.floats(-1e6, 1e6), max_size=60))
def test_pushes_and_pops_are_those_of_heapq(steps: list[float | None]) -> None:
    """None pops; a number is pushed."""
    keys, items, size = np.empty(2), np.empty(2, dtype=np.int64), 0
    reference: list[float] = []
    for serial, step in enumerate(steps):
        if step is not None:
            if size == keys.size:
                keys, items = grown(keys, items)
            size = push(keys, items, size, step, serial)
            heapq.heappush(reference, step)
        elif reference:
            size = pop(keys, items, size)
            assert keys[size] == heapq.heappop(reference)
            assert steps[items[size]] == keys[size]
    assert size == len(reference)
