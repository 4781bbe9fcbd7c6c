"""Racks off their points."""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas.planar import between
from rackhand.worlds.scatter import scattered
from rackhand.worlds.world_model import load_world
from tests.sim.helpers import make_world

WAREHOUSE = load_world("warehouse")
TURN = math.radians(4)


def test_racks_are_off_within_the_limits_and_use_them() -> None:
    shifts = np.array(
        [
            between(rack.pose, scattered(WAREHOUSE, seed, 0.05, TURN).racks[name].pose)
            for seed in range(40)
            for name, rack in WAREHOUSE.racks.items()
        ]
    )
    off, turned = np.hypot(shifts[:, 0], shifts[:, 1]), np.abs(shifts[:, 2])
    assert off.max() <= 0.05 and turned.max() <= TURN
    assert off.max() > 0.047 and turned.max() > 0.95 * TURN
    assert np.abs(shifts.mean(axis=0)).max() < 0.005


def test_the_same_seed_gives_the_same_world() -> None:
    assert scattered(WAREHOUSE, 3, 0.05, TURN) == scattered(WAREHOUSE, 3, 0.05, TURN)
    assert scattered(WAREHOUSE, 3, 0.05, TURN) != scattered(WAREHOUSE, 4, 0.05, TURN)
    assert scattered(WAREHOUSE, 3, 0.0, 0.0).racks["rack_s1"].pose[:2] == WAREHOUSE.racks["rack_s1"].pose[:2]


def test_items_move_with_their_rack() -> None:
    world = make_world(
        rack_kinds={"standard": {"size": (0.83, 0.83), "underside": 0.28, "height": 1.4, "mass": 90}},
        racks={"rack_1": {"kind": "standard", "pose": (3.0, 1.0, 0.7)}},
        items={"box": {"size": (0.2, 0.2, 0.2), "pose": (3.1, 1.2, 0.0), "lies_on": "rack_1", "level": 1}},
    )
    moved = scattered(world, 5, 0.05, TURN)
    before, after = (between(w.racks["rack_1"].pose, w.items["box"].pose) for w in (world, moved))
    assert moved.racks != world.racks
    np.testing.assert_allclose(after, before, atol=1e-12)
