"""A world whose racks are not exactly on their points, as after a day of work: seeded, for tests and benchmarks."""

from __future__ import annotations

import math
from zlib import crc32

import numpy as np

from rackhand.schemas.planar import PlanarPose, between, compose
from rackhand.worlds.world_model import World


def scattered(world: World, seed: int, offset: float, turn: float) -> World:
    """The world with each rack moved by up to ``offset`` (m) in any direction and turned by up to ``turn`` (rad).

    Uniform over the disc and the angles; the shift of a rack depends on the seed and its name only. Items on a rack
    move with it. Nothing checks that the racks still have room.
    """
    if offset == turn == 0:
        return world
    moved = {name: compose(rack.pose, _shift(name, seed, offset, turn)) for name, rack in world.racks.items()}
    racks = {name: rack.model_copy(update={"pose": moved[name]}) for name, rack in world.racks.items()}
    items = {
        name: item.model_copy(update={"pose": compose(moved[on], between(world.racks[on].pose, item.pose))})
        if (on := item.lies_on) in world.racks and on is not None
        else item
        for name, item in world.items.items()
    }
    return world.model_copy(update={"racks": racks, "items": items})


def _shift(name: str, seed: int, offset: float, turn: float) -> PlanarPose:
    """In the rack's frame."""
    radius, direction, angle = np.random.default_rng([seed, crc32(name.encode())]).random(3)
    r, phi = offset * math.sqrt(radius), 2 * math.pi * direction
    return r * math.cos(phi), r * math.sin(phi), turn * (2 * float(angle) - 1)
