"""What is loaded is kept; what becomes garbage later is not."""

import gc
import weakref
from collections.abc import Iterator

import pytest

from rackhand.runtime.memory import freeze_gc


class Node:
    """Garbage once nobody else knows it: it knows itself."""

    def __init__(self) -> None:
        self.itself = self


@pytest.fixture(autouse=True)
def unfreeze() -> Iterator[None]:
    yield
    gc.unfreeze()


def test_loaded_things_are_no_longer_looked_at() -> None:
    loaded = Node()
    freeze_gc()
    assert not any(thing is loaded for thing in gc.get_objects())
    assert len(gc.get_objects()) < 1000


def test_later_garbage_is_collected() -> None:
    freeze_gc()
    gone = weakref.ref(Node())
    gc.collect()
    assert gone() is None
