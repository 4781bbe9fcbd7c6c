"""Things that move: clusters of unmapped hits followed from scan to scan by an alpha-beta filter.

The middle of what is visible of a standing thing wanders too, when it is passed. So what counts as moving must also
have come to where nothing was a moment ago, or have left free where it was; and what lies beside hits that have been in
one place for a while is an edge of something that stands there.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import NANOSECONDS
from rackhand.services.planner.perception.observed import ObservedObstacles

Array = NDArray[np.float64]

GAP = 0.25  # m between neighbouring hits of one thing
LARGEST = 1.2  # m; larger objects count as static
GATE = 0.5  # m between a prediction and the cluster that continues it
ALPHA, BETA = 0.5, 0.2
LOST_AFTER = 8  # scans
DEPTH = 0.12  # m from the visible front of a body to its middle
LEAST_RADIUS = 0.3
MOVING_SPEED = 0.35  # m/s
MOVING_WINDOW = 7  # scans (0.5 s) over which a mover must really have got away
MOVING_DISTANCE = 0.2
FRESH_SHARE = 0.3  # of a mover's hits that lie where nothing was
STEADY_SHARE = 0.4  # of the hits of what does not move that lie beside what has been there for a while
WITNESSES, MOST_WITNESSES = 2, 4  # scans that must bear it out, of those that count
MEMORY = 10.0  # s; what moved so recently may move again


@dataclass
class Track:
    """One thing followed. Position of its middle in the map in metres, velocity in m/s."""

    position: Array
    radius: float
    velocity: Array = field(default_factory=lambda: np.zeros(2))
    trail: deque[Array] = field(default_factory=lambda: deque(maxlen=MOVING_WINDOW))  # of the visible front
    witnesses: int = 0
    missed: int = 0
    moved_at: int | None = None

    @property
    def moving(self) -> bool:
        if self.witnesses < WITNESSES or math.hypot(*self.velocity) < MOVING_SPEED:
            return False
        return math.hypot(*(self.trail[-1] - self.trail[0])) > MOVING_DISTANCE


class DynamicObstacleTracker:
    """Tracks of everything unmapped and small; ``moving`` are those that move."""

    def __init__(self) -> None:
        self._tracks: list[Track] = []
        self._stamp: int | None = None

    @property
    def moving(self) -> list[Track]:
        return [track for track in self._tracks if track.moving]

    def rows(self) -> Array:
        """Moving things as rows x, y, vx, vy, radius."""
        rows = [(*track.position, *track.velocity, track.radius) for track in self.moving]
        return np.array(rows, dtype=np.float64).reshape(-1, 5)

    def moved_near(self, point: Array, radius: float, stamp: int) -> bool:
        """Whether something that moved lately is within ``radius`` of a point."""
        return any(
            math.hypot(*(track.position - point)) < radius + track.radius
            for track in self._tracks
            if track.moved_at is not None and stamp - track.moved_at < MEMORY * NANOSECONDS
        )

    def update(self, observed: ObservedObstacles, sensor: Array, stamp: int) -> Array:
        """Take the newest scan's hits. Returns the velocity of each hit's thing, (n, 2)."""
        points = observed.points
        dt = 0.0 if self._stamp is None else (stamp - self._stamp) / NANOSECONDS
        self._stamp = stamp
        if not 0.0 < dt < 1.0:
            self._tracks = []
        for track in self._tracks:
            track.position = track.position + track.velocity * dt
            track.missed += 1
        velocities = np.zeros((len(points), 2))
        for members in _clusters(points, observed.unmapped):
            track = self._continue(points[members], sensor, dt)
            came = float(observed.fresh[members].mean()) >= FRESH_SHARE
            left = len(track.trail) == MOVING_WINDOW and observed.is_seen_free(track.trail[0])
            stays = float(observed.steady[members].mean()) >= STEADY_SHARE
            bears_out = (came or left) and not stays
            track.witnesses = min(max(track.witnesses + (1 if bears_out else -1), 0), MOST_WITNESSES)
            if track.moving:
                velocities[members] = track.velocity
                track.moved_at = stamp
        self._tracks = [track for track in self._tracks if track.missed <= LOST_AFTER]
        return velocities

    def _continue(self, hits: Array, sensor: Array, dt: float) -> Track:
        """The track these hits belong to, corrected by them; a new one if there is none."""
        front = hits.mean(axis=0)
        away = front - sensor
        middle = front + away / max(math.hypot(*away), 1e-6) * DEPTH
        radius = max(LEAST_RADIUS, 0.5 * float(np.hypot(*(hits.max(axis=0) - hits.min(axis=0)))) + 0.05)
        open_tracks = [track for track in self._tracks if track.missed > 0]
        nearest = min(open_tracks, key=lambda track: math.hypot(*(middle - track.position)), default=None)
        if nearest is None or math.hypot(*(middle - nearest.position)) > GATE:
            nearest = Track(middle, radius)
            self._tracks.append(nearest)
        else:
            residual = middle - nearest.position
            nearest.position = nearest.position + ALPHA * residual
            nearest.velocity = nearest.velocity + BETA / max(dt, 1e-3) * residual
            nearest.radius += 0.3 * (radius - nearest.radius)
            nearest.missed = 0
        nearest.trail.append(front)
        return nearest


def _clusters(points: Array, unmapped: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
    """Indices of unmapped hits that follow each other closely (the last and the first too) and are small together."""
    indices = np.nonzero(unmapped)[0]
    if len(indices) == 0:
        return []
    steps = np.hypot(*np.diff(points[indices], axis=0).T)
    groups = np.split(indices, np.nonzero(steps > GAP)[0] + 1)
    if len(groups) > 1 and np.hypot(*(points[groups[0][0]] - points[groups[-1][-1]])) < GAP:
        groups[0] = np.concatenate([groups.pop(), groups[0]])
    return [g for g in groups if len(g) >= 2 and np.ptp(points[g], axis=0).max() < LARGEST]
