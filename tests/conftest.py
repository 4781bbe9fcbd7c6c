from __future__ import annotations

from collections.abc import Iterator

import pytest
import structlog


@pytest.fixture(autouse=True)
def own_logging() -> Iterator[None]:
    """A test that sets up logging, as a command line does, leaves none of it to the next."""
    yield
    structlog.reset_defaults()
