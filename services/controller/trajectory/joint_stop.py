"""The fastest stop of the joints: each for itself, within its acceleration and jerk, off the path if need be."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.services.controller.trajectory.model import JointLimits
from rackhand.services.controller.trajectory.stream import Sample


@dataclass(frozen=True)
class JointStop:
    """Three stretches of constant jerk a joint: ``times`` (4, n) their ends from the start on, states at these times.

    ``q``, ``dq``, ``ddq`` (4, n) begin each stretch; ``jerk`` (4, n) acts in it and is 0 in the last, rest.
    """

    began: float
    times: Array
    q: Array
    dq: Array
    ddq: Array
    jerk: Array

    @property
    def end(self) -> float:
        return self.began + float(self.times[-1].max())

    @property
    def rest(self) -> Array:
        return np.asarray(self.q[-1])

    def at(self, t: float) -> Sample:
        since = max(t - self.began, 0.0)
        stretch = (self.times[1:] <= since).sum(axis=0)
        joint = np.arange(self.q.shape[1])
        q, dq, ddq, jerk = (row[stretch, joint] for row in (self.q, self.dq, self.ddq, self.jerk))
        d = np.where(stretch == 3, 0.0, since - self.times[stretch, joint])
        return Sample(
            q + d * (dq + d * (ddq / 2 + d * jerk / 6)),
            dq + d * (ddq + d * jerk / 2),
            ddq + d * jerk,
            None,
            0.0,
            t >= self.end,
        )


def stop_joints(t: float, now: Sample, limits: JointLimits) -> JointStop:
    """The stop from the state ``now`` at ``t``.

    With the speed v that is left when a joint's acceleration a just fades, the deceleration peaks at
    p = √(J v₀ + a²/2), or at its limit, which is then held.
    """
    J = limits.jerk
    side = np.where(now.dq + now.ddq * np.abs(now.ddq) / (2 * J) >= 0, 1.0, -1.0)
    v, a = side * now.dq, side * now.ddq
    free = np.sqrt(np.maximum(J * v + a * a / 2, 0.0))
    peak = np.maximum(np.minimum(free, limits.acceleration), -a)
    hold = np.maximum(v + (a * a / 2 - peak * peak) / J, 0.0) / np.maximum(peak, 1e-12)
    durations = np.stack([np.maximum(a + peak, 0.0) / J, hold, peak / J])
    jerk = side * np.stack([-J, np.zeros_like(J), J, np.zeros_like(J)])
    q, dq, ddq = [now.q], [now.dq], [now.ddq]
    for d, j in zip(durations, jerk[:3], strict=True):
        q.append(q[-1] + d * (dq[-1] + d * (ddq[-1] / 2 + d * j / 6)))
        dq.append(dq[-1] + d * (ddq[-1] + d * j / 2))
        ddq.append(ddq[-1] + d * j)
    # Rounding must not leave a joint creeping.
    dq[-1], ddq[-1] = np.zeros_like(J), np.zeros_like(J)
    times = np.concatenate([np.zeros((1, J.size)), np.cumsum(durations, axis=0)])
    return JointStop(t, times, np.stack(q), np.stack(dq), np.stack(ddq), jerk)
