"""A gateway for each test that asks for one: one server for all of them, everything else fresh."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tests.gateway.harness import Gateway, running_gateway


@pytest.fixture(scope="package")
def server() -> Iterator[Gateway]:
    with running_gateway() as running:
        yield running


@pytest.fixture
def gateway(server: Gateway) -> Gateway:
    server.begin_anew()
    return server
