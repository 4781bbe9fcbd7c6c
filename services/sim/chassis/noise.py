"""Seeded noise: one generator for each sensor of each robot, drawn from once a publication and from nothing else."""

from __future__ import annotations

import math
from dataclasses import dataclass
from zlib import crc32

import numpy as np
from numpy.typing import NDArray


def generator(seed: int, *names: str) -> np.random.Generator:
    """The stream of that name: the same seed and name give the same stream, whatever else exists."""
    return np.random.default_rng([seed, *(crc32(name.encode()) for name in names)])


@dataclass(frozen=True)
class NoiseSettings:
    """1σ of what is measured. ``pose_xy`` (m) and ``pose_yaw`` (rad) are those of the localised pose as a whole.

    ``scale`` multiplies all of it; 0 makes every sensor exact.
    """

    pose_xy: float = 0.01
    pose_yaw: float = 0.005
    encoder_scale: float = 0.0005
    encoder_white: float = 0.0005
    gyro: float = 0.002
    gyro_bias: float = 0.001
    accelerometer: float = 0.02
    scale: float = 1.0


# Share of the pose's variance that wanders slowly (as a scan matcher's does), and how slowly.
SLOW_SHARE = 0.64
CORRELATION_TIME = 5.0


class PoseNoise:
    """Errors of a localised pose: a slow first-order Gauss–Markov part and a white one.

    The slow part steps by x' = a·x + √(1-a²)·σ·n with a = exp(-dt/τ), which keeps its variance.
    """

    def __init__(self, settings: NoiseSettings, rng: np.random.Generator, period: float) -> None:
        sigma = np.array([settings.pose_xy, settings.pose_xy, settings.pose_yaw]) * settings.scale
        self.sigma = sigma
        self._rng = rng
        self._slow_sigma, self._white_sigma = sigma * math.sqrt(SLOW_SHARE), sigma * math.sqrt(1 - SLOW_SHARE)
        self._keep = math.exp(-period / CORRELATION_TIME)
        self._slow = self._slow_sigma * rng.standard_normal(3)

    def draw(self) -> NDArray[np.float64]:
        """The error of (x, y, yaw) of the next publication."""
        drive = math.sqrt(1 - self._keep**2)
        self._slow = self._keep * self._slow + drive * self._slow_sigma * self._rng.standard_normal(3)
        return np.asarray(self._slow + self._white_sigma * self._rng.standard_normal(3))
