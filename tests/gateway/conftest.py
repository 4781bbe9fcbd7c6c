"""A gateway for each test that asks for one: one server for all of them, everything else fresh."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from rackhand.services.gateway.settings import Settings
from tests.gateway.fake_arm import ArmCell, FakeArm
from tests.gateway.harness import Gateway, running_gateway


@pytest.fixture(scope="package")
def server() -> Iterator[Gateway]:
    with running_gateway() as running:
        yield running


@pytest.fixture
def gateway(server: Gateway) -> Gateway:
    server.reset()
    return server


@pytest.fixture
def cell() -> Iterator[ArmCell]:
    with running_gateway(Settings(arms=("arm1",))) as gateway:
        arm = FakeArm()
        object.__setattr__(gateway.shared, "bus", arm)
        yield gateway, arm, gateway.context
