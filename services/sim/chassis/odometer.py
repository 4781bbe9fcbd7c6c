"""Wheel odometry from noisy encoders: the pose by dead reckoning."""

from __future__ import annotations

import math

import numpy as np

from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import Odometry
from rackhand.schemas.planar import wrap
from rackhand.services.sim.chassis.noise import NoiseSettings
from rackhand.worlds.chassis_model import WheelDrive


class Odometer:
    """Integrates the turning of two wheels. Each encoder has a scale error of its own, drawn once, and white noise that
    grows with the root of the way.
    """

    def __init__(
        self, drive: WheelDrive, noise: NoiseSettings, rng: np.random.Generator, angles: tuple[float, float]
    ) -> None:
        self._drive = drive
        self._rng = rng
        self._scale = 1.0 + noise.scale * noise.encoder_scale * rng.standard_normal(2)
        self._white = noise.scale * noise.encoder_white
        self._angles = np.array(angles)
        self._pose = (0.0, 0.0, 0.0)

    def measure(self, angles: tuple[float, float], stamp: int, dt: float) -> Odometry:
        """Take in the wheels' true angles (rad: left, right), ``dt`` seconds (0 at the start) after the last ones."""
        now = np.array(angles)
        way = (now - self._angles) * self._scale
        way += self._white * np.sqrt(np.abs(way)) * self._rng.standard_normal(2)
        self._angles = now
        left, right = (float(w) for w in way * self._drive.wheel_radius)
        forward, turn = (left + right) / 2, (right - left) / self._drive.wheel_separation
        x, y, yaw = self._pose
        middle = yaw + turn / 2
        self._pose = (x + forward * math.cos(middle), y + forward * math.sin(middle), wrap(yaw + turn))
        rate = 1.0 / dt if dt > 0 else 0.0
        return Odometry(
            stamp=stamp,
            pose=Pose2(x=self._pose[0], y=self._pose[1], yaw=self._pose[2]),
            twist=Twist2(linear=forward * rate, angular=turn * rate),
            wheel_velocities=(float(way[0]) * rate, float(way[1]) * rate),
        )
