from __future__ import annotations

from collections.abc import Iterator

import pytest
import structlog
from hypothesis import settings

# The first example of a test of compiled code waits for the compiler; the same examples in every run.
settings.register_profile("rackhand", deadline=None, derandomize=True)
settings.load_profile("rackhand")


@pytest.fixture(autouse=True)
def own_logging() -> Iterator[None]:
    """A test that sets up logging, as a command line does, leaves none of it to the next."""
    yield
    structlog.reset_defaults()
