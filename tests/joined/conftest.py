"""Joined worlds for tests: each begins anew, so that no test depends on another."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from rackhand.services.controller import ik
from rackhand.worlds.world_model import World, load_world
from tests.joined.arm import JoinedArm
from tests.joined.chassis import JoinedChassis
from tests.joined.world import JoinedWorld


@cache
def pick_station(kind: str) -> World:
    world = load_world("pick_station")
    arms = {name: place.model_copy(update={"kind": kind}) for name, place in world.arms.items()}
    return world.model_copy(update={"arms": arms})


@pytest.fixture(params=["ur5e", "fr3"])
def either(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[JoinedArm, ik.Arm]]:
    """The pick station with one arm or the other, at rest at home."""
    with JoinedWorld(pick_station(request.param), tmp_path) as world:
        station = world.arm()
        station.advance(0.04)
        yield station, station.arm


@pytest.fixture
def driver(tmp_path: Path) -> Iterator[JoinedChassis]:
    """The chassis of the warehouse, where it begins."""
    with JoinedWorld("warehouse", tmp_path, with_arms=False) as world:
        yield world.chassis()
