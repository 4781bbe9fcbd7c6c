"""Where the chassis is: odometry between localised poses, weighed by an extended Kalman filter."""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.perception.chassis_state import Observation
from rackhand.services.planner.settings import PoseNoise

HISTORY = 2 * NANOSECONDS
JUMP_DISTANCE = 0.25  # m; an innovation beyond it, three times in a row, is a robot that was set down elsewhere
JUMP_YAW = 0.2
JUMPS = 3
SURPRISE = 16.0  # squared Mahalanobis distance that 1 of 1000 honest measurements exceeds
INFLATION = 4.0  # of the covariance, at a measurement that surprises
LARGEST_SIGMA = np.array([2.0, 2.0, 1.0])  # m, m, rad; knowing less than this is knowing nothing
LEAP = 5.0  # m between two odometry samples: its origin has changed, nothing has moved


class PoseFilter:
    """State: pose in the map. Predicted by what odometry moved since, corrected by each localised pose once.

    A localised pose is compared at its own stamp, moved on by odometry to now.
    """

    def __init__(self, noise: PoseNoise) -> None:
        self._noise = noise
        self._odometry: deque[tuple[int, Pose]] = deque()
        self._pose: Pose | None = None
        self._covariance = np.eye(3)
        self._measured_at = -1
        self._jumps = 0

    @property
    def pose(self) -> Pose:
        """The pose at the newest observation, in the map."""
        if self._pose is None:
            raise RuntimeError("no observation yet")
        return self._pose

    @property
    def covariance(self) -> NDArray[np.float64]:
        """(3, 3) of x, y, yaw in m and rad: symmetric and positive."""
        return self._covariance

    @property
    def is_doubtful(self) -> bool:
        """Whether the newest localised poses are far from the estimate: one of both is wrong."""
        return self._jumps > 0

    def update(self, seen: Observation) -> None:
        if self._odometry and seen.stamp < self._odometry[-1][0]:
            self._restart()
        now = se2.pose(seen.odometry)
        if self._odometry and math.dist(self._odometry[-1][1][:2], now[:2]) > LEAP:
            self._odometry.clear()
        if self._odometry and self._pose is not None:
            self._predict(se2.between(self._odometry[-1][1], now))
        self._remember(seen.stamp, now)
        if seen.pose_stamp != self._measured_at:
            self._measured_at = seen.pose_stamp
            self._correct(se2.compose(se2.pose(seen.pose), se2.between(self.odometry_at(seen.pose_stamp), now)))

    def at(self, stamp: int) -> Pose:
        """The pose at an earlier stamp: today's estimate moved back by odometry."""
        return se2.compose(self.pose, se2.between(self._odometry[-1][1], self.odometry_at(stamp)))

    def _restart(self) -> None:
        self._odometry.clear()
        self._pose = None
        self._measured_at = -1

    def _remember(self, stamp: int, odometry: Pose) -> None:
        if self._odometry and self._odometry[-1][0] == stamp:
            self._odometry.pop()
        self._odometry.append((stamp, odometry))
        while self._odometry[0][0] < stamp - HISTORY:
            self._odometry.popleft()

    def odometry_at(self, stamp: int) -> Pose:
        """Odometry at a stamp, between two of its samples; the nearest one beyond what is remembered."""
        later_stamp, later = self._odometry[-1]
        for earlier_stamp, earlier in reversed(self._odometry):
            if earlier_stamp <= stamp:
                if stamp >= later_stamp:
                    return later
                return se2.interpolate(earlier, later, (stamp - earlier_stamp) / (later_stamp - earlier_stamp))
            later_stamp, later = earlier_stamp, earlier
        return later

    def _predict(self, moved: Pose) -> None:
        pose = self.pose
        driven, turned = math.hypot(moved[0], moved[1]), abs(moved[2])
        c, s = math.cos(pose[2]), math.sin(pose[2])
        jacobian = np.eye(3)
        jacobian[0, 2] = -s * moved[0] - c * moved[1]
        jacobian[1, 2] = c * moved[0] - s * moved[1]
        n = self._noise
        sigma = n.odometry_per_metre * driven + 1e-5
        sigma_yaw = n.odometry_yaw_per_metre * driven + n.odometry_yaw_per_radian * turned + 1e-5
        self._pose = se2.compose(pose, moved)
        # Errors of odometry persist over a metre, so they add up faster than independent steps would: hence the 10.
        process = np.diag([sigma**2, sigma**2, sigma_yaw**2]) * 10.0
        self._covariance = bounded(jacobian @ self._covariance @ jacobian.T + process)

    def _correct(self, measured: Pose) -> None:
        r = np.diag([self._noise.position**2, self._noise.position**2, self._noise.yaw**2])
        if self._pose is None:
            self._pose, self._covariance = measured, r
            return
        innovation = measured - self._pose
        innovation[2] = se2.wrap(innovation[2])
        self._jumps = self._jumps + 1 if _is_far(innovation) else 0
        if self._jumps >= JUMPS:
            self._pose, self._covariance = measured, r
            return
        if self._jumps > 0:  # a wild measurement or the first of a new place: the next ones show which
            self._covariance = bounded(self._covariance * INFLATION)
            return
        s = self._covariance + r
        if innovation @ np.linalg.solve(s, innovation) > SURPRISE:
            self._covariance = bounded(self._covariance * INFLATION)
            s = self._covariance + r
        gain = np.linalg.solve(s, self._covariance).T
        self._pose = self._pose + gain @ innovation
        self._pose[2] = se2.wrap(self._pose[2])
        # Joseph form: positive and symmetric whatever the rounding (Bucy & Joseph 1968).
        kept = np.eye(3) - gain
        self._covariance = bounded(kept @ self._covariance @ kept.T + gain @ r @ gain.T)


def _is_far(innovation: Pose) -> bool:
    return math.hypot(innovation[0], innovation[1]) > JUMP_DISTANCE or abs(innovation[2]) > JUMP_YAW


def bounded(covariance: NDArray[np.float64]) -> NDArray[np.float64]:
    """The symmetric part of a covariance (3, 3), with no standard deviation above ``LARGEST_SIGMA``; correlations are
    kept."""
    symmetric = 0.5 * (covariance + covariance.T)
    shrink = np.minimum(1.0, LARGEST_SIGMA / np.sqrt(np.diag(symmetric)))
    kept: NDArray[np.float64] = symmetric * np.outer(shrink, shrink)
    return kept
