"""The two arms, read once."""

import pytest

from rackhand.services.controller.ik import Arm, load_arm


@pytest.fixture(scope="session", params=["ur5e", "fr3"])
def arm(request: pytest.FixtureRequest) -> Arm:
    return load_arm(request.param)


@pytest.fixture(scope="session")
def ur5e() -> Arm:
    return load_arm("ur5e")


@pytest.fixture(scope="session")
def fr3() -> Arm:
    return load_arm("fr3")
