"""A 2-D lidar by ray casting."""

from __future__ import annotations

import math
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Scan
from rackhand.schemas.planar import wrap
from rackhand.services.sim.mjcf.layers import VISIBLE_GROUP
from rackhand.worlds.chassis_model import LidarKind

_SEEN = np.array([group == VISIBLE_GROUP for group in range(6)], dtype=np.uint8)


class Lidar:
    """Sees every visible geom but those of the body that carries it."""

    def __init__(self, kind: LidarKind, body: int, rng: np.random.Generator, noise_scale: float) -> None:
        self.kind = kind
        self._body = body
        self._rng = rng
        self._sigma = kind.noise * noise_scale
        x, y, yaw = kind.pose
        self._offset = np.array([x, y, kind.height])
        angles = yaw + kind.angle_min + kind.angle_step * np.arange(kind.beams)
        self._rays = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(kind.beams)])
        self._pose = Pose2(x=x, y=y, yaw=wrap(yaw))
        self._geoms = np.empty(kind.beams, dtype=np.int32)
        self._distances = np.empty(kind.beams)

    def scan(self, model: Any, data: Any, stamp: int, blind: bool = False, more_noise: float = 0.0) -> Scan:
        """A scan of the world as ``data``'s frames have it; blind, no beam has a measurement. ``more_noise``: standard
        deviation (m) that is added to the lidar's own.

        Noise is drawn also when blind: its stream goes on.
        """
        noise = math.hypot(self._sigma, more_noise) * self._rng.standard_normal(self.kind.beams)
        ranges = np.full(self.kind.beams, np.nan) if blind else self._cast(model, data) + noise
        return Scan(
            stamp=stamp,
            sensor=self._pose,
            angle_min=self.kind.angle_min,
            angle_step=self.kind.angle_step,
            range_max=self.kind.range_max,
            ranges=np.maximum(ranges, 0.0).astype(np.float32),
        )

    def _cast(self, model: Any, data: Any) -> NDArray[np.float64]:
        rotation = data.xmat[self._body].reshape(3, 3)
        origin = data.xpos[self._body] + rotation @ self._offset
        rays = np.ascontiguousarray(self._rays @ rotation.T).ravel()
        mujoco.mj_multiRay(
            model,
            data,
            origin,
            rays,
            _SEEN,
            True,
            self._body,
            self._geoms,
            self._distances,
            None,
            self.kind.beams,
            self.kind.range_max,
        )
        missed = (self._distances < 0) | (self._distances > self.kind.range_max)
        return np.where(missed, np.inf, self._distances)
