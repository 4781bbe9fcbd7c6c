"""What the next tick will need and is known before it: computed once, between ticks where there is time for it."""

from __future__ import annotations

from rackhand.schemas.arrays import Array
from rackhand.services.controller.motion.kinematics import ArmKinematics
from rackhand.services.controller.trajectory.queue import MotionQueue
from rackhand.services.controller.trajectory.stream import Sample


class Foresight:
    """Remembers the last result of each kind. A queue is never changed, nor are commanded positions: others are other
    objects, by which a result that has been overtaken is known."""

    def __init__(self, kinematics: ArmKinematics) -> None:
        self._kinematics = kinematics
        self._sampled: tuple[MotionQueue, float, Sample] | None = None
        self._turned: tuple[Array, Array] | None = None

    def sample(self, queue: MotionQueue, t: float) -> Sample:
        """The queue's reference at ``t``."""
        if self._sampled is None or self._sampled[0] is not queue or self._sampled[1] != t:
            self._sampled = queue, t, queue.at(t)
        return self._sampled[2]

    def rotation(self, q: Array) -> Array:
        """(3, 3), of the flange in the base at ``q`` (n,)."""
        if self._turned is None or self._turned[0] is not q:
            self._turned = q, self._kinematics.forward(q).rotation
        return self._turned[1]
