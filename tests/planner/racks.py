"""Racks in the 2-D plant: their legs as polygons, and scans of them as points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.perception.seen_scan import points_of
from tests.planner.plant import BODY, Hall, Plant, box

Array = NDArray[np.float64]

STANDARD = RackSpec(width=0.83, depth=0.83)
LARGE = RackSpec(width=0.9, depth=1.2, leg_size=0.04)
SPECS = (STANDARD, LARGE)
SENSOR = np.array([0.2, 0.0, 0.0])
CORNERS = ((1, 1), (-1, 1), (-1, -1), (1, -1))


def legs(spec: RackSpec, rack: Sequence[float], without: Sequence[int] = ()) -> list[Array]:
    """The legs of a rack there, front left first and counter-clockwise."""
    half = 0.5 * (np.array([spec.depth, spec.width]) - spec.leg_size)
    middles = se2.transformed(np.array(rack), np.array(CORNERS) * half)
    return [box(*m, spec.leg_size, spec.leg_size, rack[2]) for k, m in enumerate(middles) if k not in without]


def look(things: Sequence[Array], seed: int = 0, pose: Sequence[float] = (6.0, 6.0, 0.0)) -> Array:
    """Points that a chassis there sees of things given in the map frame, in a hall of 12 x 12 m; (n, 2) in the chassis
    frame. Range noise of 1 cm."""
    plant = Plant(Hall(12.0, 12.0), (pose[0], pose[1], pose[2]), seed)
    plant.crates = list(things)
    scan = plant.observe().scan
    assert scan is not None
    return points_of(scan, 8.0, Footprint.of(BODY))
