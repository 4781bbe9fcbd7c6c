from __future__ import annotations

from collections.abc import Iterator

import pytest
import structlog
from hypothesis import settings

# The first example of a test of compiled code waits for the compiler; the same examples in every run.
settings.register_profile("rackhand", deadline=None, derandomize=True)
settings.load_profile("rackhand")


# Files with the longest tests of processes. Two workers take whole files: what begins last should be short.
LONGEST_FIRST = ("scenarios", "demo", "readme", "viewer", "lockstep", "examples")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    order = {f"test_{name}": number for number, name in enumerate(LONGEST_FIRST)}
    items.sort(key=lambda item: order.get(item.path.stem, len(order)))


@pytest.fixture(autouse=True)
def own_logging() -> Iterator[None]:
    """A test that sets up logging, as a command line does, leaves none of it to the next."""
    yield
    structlog.reset_defaults()
