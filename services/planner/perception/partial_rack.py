"""A rack of which only some legs can be seen: known from its registered point and two legs that are where one of its
kind has them.

Racks stand up to 5 cm and 4° off their points, which bounds what is taken for one. All poses are in the frame of the
scan's points; a rack's frame is that of ``rackhand.schemas.racks.RackSpec``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import combinations, permutations

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.perception.clusters import Clusters
from rackhand.services.planner.perception.rack_legs import leg_middles

Array = NDArray[np.float64]

OFF, TURNED = 0.15, math.radians(8.0)  # m and rad off its point, within which two legs are taken for those of a rack
LENGTH_TOLERANCE = 0.04  # m by which the distance of two clusters may differ from that of two legs


def racks_of_two_legs(clusters: Clusters, place: Pose, specs: Sequence[RackSpec]) -> list[tuple[Pose, RackSpec]]:
    """Racks near ``place`` two of whose legs are clusters, the nearest to it first; none for most places."""
    found = [(pose, spec) for spec in specs for pose in _poses(_near(clusters, place, spec), place, spec)]
    return sorted(found, key=lambda one: math.hypot(*(one[0][:2] - place[:2])))


def _near(clusters: Clusters, place: Pose, spec: RackSpec) -> Array:
    """Middles (n, 2) of the clusters that can be legs of a rack there."""
    reach = OFF + 0.5 * math.hypot(spec.depth, spec.width)
    near: Array = clusters.middles[np.hypot(*(clusters.middles - place[:2]).T) <= reach]
    return near


def _poses(middles: Array, place: Pose, spec: RackSpec) -> Iterator[Pose]:
    legs = leg_middles(spec)
    for leg, other in combinations(legs, 2):
        side = other - leg
        for first, second in permutations(middles, 2):
            seen = second - first
            if abs(math.hypot(*seen) - math.hypot(*side)) > LENGTH_TOLERANCE:
                continue
            yaw = wrap(math.atan2(seen[1], seen[0]) - math.atan2(side[1], side[0]))
            turned = se2.transformed(np.array([0.0, 0.0, yaw]), 0.5 * (leg + other)[None])[0]
            pose = np.array([*(0.5 * (first + second) - turned), yaw])
            if math.hypot(*(pose[:2] - place[:2])) <= OFF and abs(wrap(yaw - place[2])) <= TURNED:
                yield pose
