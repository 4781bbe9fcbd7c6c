"""A binary heap on two arrays, for compiled searches (the standard one on lists of tuples is half as fast)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled

Keys = NDArray[np.float64]
Items = NDArray[np.int64]


@compiled
def push(keys: Keys, items: Items, size: int, key: float, item: int) -> int:
    """Returns the new size. The arrays must have room."""
    i = size
    while i > 0:
        parent = (i - 1) >> 1
        if keys[parent] <= key:
            break
        keys[i] = keys[parent]
        items[i] = items[parent]
        i = parent
    keys[i] = key
    items[i] = item
    return size + 1


@compiled
def pop(keys: Keys, items: Items, size: int) -> int:
    """Takes the smallest off, leaving it at index ``size - 1``; returns the new size."""
    top_key, top_item = keys[0], items[0]
    size -= 1
    key, item = keys[size], items[size]
    i = 0
    while True:
        child = 2 * i + 1
        if child >= size:
            break
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        keys[i] = keys[child]
        items[i] = items[child]
        i = child
    keys[i] = key
    items[i] = item
    keys[size] = top_key
    items[size] = top_item
    return size


@compiled
def grown(keys: Keys, items: Items) -> tuple[Keys, Items]:
    """The same heap with twice the room."""
    more_keys = np.empty(2 * keys.size, dtype=np.float64)
    more_items = np.empty(2 * items.size, dtype=np.int64)
    more_keys[: keys.size] = keys
    more_items[: items.size] = items
    return more_keys, more_items
