"""How near the arm is to itself and to what surrounds it: distances of solids, by coal (GJK).

Spheres in the QP (``collision``) are for zones that a client sets; here every primitive of the MJCF counts as it is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from rackhand.runtime.compiled import compiled
from rackhand.schemas.arrays import Array
from rackhand.services.controller.ik.arm import Arm
from rackhand.services.controller.ik.collision import Point, add_derivative
from rackhand.services.controller.ik.kernels import forward
from rackhand.services.controller.ik.solids import Solid, levers

MARGIN = 5e-3  # m kept between solids
STEP = 4e-3  # m that no point of the arm exceeds between two postures of a path that are looked at
RECEDING = 1e-4  # m: solids that are nearer than the margin at first may come nearer by this
BRAKING_SHARE = 0.5  # of their acceleration with which joints brake before an obstacle, so that curvature can be met


class Conflict(NamedTuple):
    """Posture number ``number`` of those that were looked at is too near: ``pair`` are ``distance`` [m] apart."""

    number: int
    pair: tuple[str, str]
    distance: float

    def __str__(self) -> str:
        one, other = self.pair
        if self.distance <= 0:
            return f"{one} and {other} would collide"
        return f"{one} and {other} come within {1e3 * self.distance:.1f} mm, at least {1e3 * MARGIN:g} mm are kept"


class Clearance:
    """Of one arm. Has working memory: one instance a thread."""

    def __init__(self, arm: Arm) -> None:
        self._arm = arm
        solids = (*arm.solids, *arm.surroundings)
        self._shapes = pin.GeometryModel()
        for i, solid in enumerate(solids):
            self._shapes.addGeometryObject(_geometry(i, solid))
        pairs = [
            (a, b)
            for a, one in enumerate(solids)
            for b, other in enumerate(solids[: len(arm.solids)])
            if (b < a or a >= len(arm.solids)) and abs(one.joint - other.joint) > 1
        ]
        for a, b in pairs:
            self._shapes.addCollisionPair(pin.CollisionPair(a, b))
        self.pairs = tuple((solids[b].name, solids[a].name) for a, b in pairs)
        self._joints = np.array([(solids[a].joint, solids[b].joint) for a, b in pairs], np.int64).reshape(-1, 2)
        self._data, self._placed = arm.model.createData(), pin.GeometryData(self._shapes)
        self._levers = levers(arm, solids)
        self._frames = np.empty((arm.n + 1, 3, 4))

    def distances(self, q: Array) -> Array:
        """Of every pair [m] at ``q`` (n,); negative where they overlap."""
        pin.computeDistances(self._arm.model, self._data, self._shapes, self._placed, q)
        return np.array([result.min_distance for result in self._placed.distanceResults])

    def travel(self, q: Array) -> Array:
        """(k,) [m] from the first of the postures ``q`` (k, n) on: no point of the arm has moved farther."""
        steps = np.abs(np.diff(q, axis=0)) @ self._levers
        return np.concatenate([[0.0], np.cumsum(steps)])

    def first_conflict(self, q: Array) -> Conflict | None:
        """Where the postures ``q`` (k, n), each near the one before, first come too near. Pairs that are near at first
        may stay and recede. Postures are passed over where the distances show that nothing can be reached."""
        if not self.pairs:
            return None
        travel = self.travel(q)
        i, now = 0, self.distances(q[0])
        least = np.minimum(MARGIN, now - RECEDING)
        while i < len(q) - 1:
            i = min(max(i + 1, int(np.searchsorted(travel, travel[i] + float((now - least).min())))), len(q) - 1)
            now = self.distances(q[i])
            worst = int(np.argmin(now - least))
            if now[worst] < least[worst]:
                return Conflict(i, self.pairs[worst], float(now[worst]))
        return None

    def speed_share(self, q: Array, v: Array, dt: float) -> float:
        """The factor 0 … 1 by which to slow the joint velocities ``v`` (n,) at ``q``, so that from the next period on
        the joints can brake, all together, before any two solids come nearer than the margin."""
        if not self.pairs or not v.any():
            return 1.0
        gaps = self.distances(q) - MARGIN
        braking = float(BRAKING_SHARE * (self._arm.limits.acceleration / np.maximum(np.abs(v), 1e-9)).min())
        fastest = float(np.abs(v) @ self._levers)
        near = np.flatnonzero(gaps < fastest / (2 * braking) + fastest * dt)
        if not near.size:
            return 1.0
        forward(self._arm.placements, q, self._frames)
        results = [self._placed.distanceResults[i] for i in near.tolist()]
        points = np.array([(r.getNearestPoint1(), r.getNearestPoint2(), r.normal) for r in results])
        return float(_speed_share(self._frames, self._joints[near], points, gaps[near], v, braking, dt))


@compiled
def _speed_share(
    frames: Array, joints: NDArray[np.int64], points: Array, gaps: Array, v: Array, braking: float, dt: float
) -> float:
    """``points`` (m, 3, 3): nearest points of both solids of each pair, and the normal from the first to the second;
    ``gaps`` (m,) [m]; ``braking``: share of ``v`` that can be taken away in a second."""
    share, row = 1.0, np.empty(v.shape[0])
    for k in range(gaps.shape[0]):
        row[:] = 0.0
        a: Point = (points[k, 0, 0], points[k, 0, 1], points[k, 0, 2])
        b: Point = (points[k, 1, 0], points[k, 1, 1], points[k, 1, 2])
        x, y, z = points[k, 2, 0], points[k, 2, 1], points[k, 2, 2]
        add_derivative(frames, joints[k, 0], a, x, y, z, row)
        add_derivative(frames, joints[k, 1], b, -x, -y, -z, row)
        closing = 0.0
        for i in range(v.shape[0]):
            closing += row[i] * v[i]
        if closing <= 0.0:
            continue
        # With the share f of v: (f closing)² ≤ 2 (braking closing) gap, and half a period's braking in discrete time.
        allowed = math.sqrt(2.0 * braking * max(gaps[k], 0.0) / closing) - 0.5 * braking * dt
        share = min(share, max(allowed, 0.0))
    return share


def _geometry(number: int, solid: Solid) -> pin.GeometryObject:
    size = solid.size
    match solid.kind:
        case "sphere":
            shape = coal.Sphere(size[0])
        case "capsule":
            shape = coal.Capsule(size[0], 2 * size[1])
        case "cylinder":
            shape = coal.Cylinder(size[0], 2 * size[1])
        case "box":
            shape = coal.Box(2 * size[0], 2 * size[1], 2 * size[2])
    pose = pin.SE3(solid.pose[:, :3], solid.pose[:, 3])
    return pin.GeometryObject(f"{number} {solid.name}", solid.joint + 1, pose, shape)
