"""A gateway for each test that asks for one: one server for all of them, everything else fresh."""

from __future__ import annotations

from collections.abc import Iterator
from typing import cast

import pytest

from rackhand.services.gateway.context import Context
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
        context = cast(Context, gateway._context)
        object.__setattr__(context, "bus", arm)
        yield gateway, arm, context
