"""A perfect arm (``arm``) as a driver of its own: states by the absolute clock, commands taken as they come.

Like a real robot it publishes neither a world's clock nor a presence. Its time is the number of states it has told, so
that it may pause between two turns without anybody noticing.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from types import TracebackType
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.motion.arm import PerfectArm
from rackhand.bus import Bus, Sample
from rackhand.schemas import topics
from rackhand.schemas.codec import codec_for
from rackhand.schemas.motion import ArmCommand, ArmState, FencingToken, Following
from rackhand.schemas.service import ServiceId
from rackhand.services.controller.ik import Arm, load_arm

if TYPE_CHECKING:
    from benchmarks.motion.cell import MotionCell

ARM = "arm1"
STATE_PERIOD = 0.002  # [s]
_STATE_NS = 2_000_000
STILL = 1e-6  # rad/s


class Driver:
    """The driver of ``arm1``. ``moved``: when [s, perf_counter] a command first differed from the one before it."""

    def __init__(self, cell: MotionCell) -> None:
        self._bus = Bus(ServiceId("driver", ARM), cell.bus)
        self._arm = PerfectArm(arm_of(cell.joints), STATE_PERIOD)
        self._commanded: tuple[float, ...] = ()  # by the command in force
        self._stamp = 0
        self._follows = Following()
        self._told: dict[int, float] = {}  # stamp → when it was published, of those recorded
        self._answered: dict[int, float] = {}
        self.moved: float | None = None

    def __enter__(self) -> Driver:
        bus = self._bus.__enter__()
        self._states = bus.publisher(topics.ARM_STATE, ARM)
        self._inbox = bus.inbox().subscribe(topics.ARM_COMMAND, ARM)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bus.__exit__(kind, error, trace)

    @property
    def stands(self) -> bool:
        return bool(np.abs(self._arm.dq).max() < STILL)

    def run_for(self, seconds: float, record: bool = False) -> None:
        """Be there for so long. With ``record`` every state of this time counts, the last ones until their answer is
        due."""
        count = round(seconds / STATE_PERIOD)
        begun = time.perf_counter()
        for i in range(count + 10):
            self._listen_until(begun + i * STATE_PERIOD)
            self._tell(record and i < count)

    def _tell(self, record: bool) -> None:
        self._stamp += _STATE_NS
        arm = self._arm
        arm.advance()
        q, dq, efforts = (tuple(values.tolist()) for values in (arm.q, arm.dq, arm.efforts))
        state = ArmState(stamp=self._stamp, q=q, dq=dq, efforts=efforts, wrench=(0.0,) * 6, follows=self._follows)
        if record:
            self._told[self._stamp] = time.perf_counter()
        self._states.put(state)

    def _listen_until(self, due: float) -> None:
        while True:
            event = self._inbox.get(max(0.0, due - time.perf_counter()))
            if isinstance(event, Sample):
                self._take(event.message, time.perf_counter())
            elif time.perf_counter() >= due:
                return

    def _take(self, command: ArmCommand, now: float) -> None:
        self._answered.setdefault(command.answers, now)
        if command.mode != "position" or command.answers <= self._follows.answers:
            return
        if self.moved is None and _differ(command.values, self._commanded):
            self.moved = now
        self._commanded = command.values
        self._follows = Following(token=command.token, answers=command.answers)
        self._arm.go_to(np.array(command.values), command.answers * 1e-9)

    def latencies(self, period: float) -> list[float]:
        """Seconds from state to command for the states that ask for one, the first of each period; inf if none came."""
        every = round(period * 1e9)
        asked = [stamp for stamp in sorted(self._told) if stamp % every == 0]
        return [self._answered.get(stamp, math.inf) - self._told[stamp] for stamp in asked]

    @property
    def position(self) -> tuple[float, ...]:
        return tuple(self._arm.q.tolist())

    @staticmethod
    def sizes_of(joints: int) -> tuple[int, int]:
        """Bytes of a state and of a command."""
        values = tuple(0.1 * (i + 1) for i in range(joints))
        token = FencingToken(epoch="0123456789abcdef", lease=1)
        follows = Following(token=token, answers=10**10)
        state = ArmState(stamp=10**10, q=values, dq=values, efforts=values, wrench=(0.1,) * 6, follows=follows)
        command = ArmCommand(answers=10**10, mode="position", values=values, token=token)
        return len(codec_for(ArmState).dumps(state)), len(codec_for(ArmCommand).dumps(command))


def _differ(values: Sequence[float], before: Sequence[float]) -> bool:
    return bool(before) and any(abs(new - old) > 1e-11 for new, old in zip(values, before, strict=True))


def arm_of(joints: int) -> Arm:
    """The default arm with so many joints."""
    return load_arm("ur5e" if joints == 6 else "fr3")
