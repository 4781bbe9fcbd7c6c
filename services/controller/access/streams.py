"""The deadman of velocity and torque references. Times are nanoseconds of the arm's clock (``world/clock``)."""

from __future__ import annotations

from dataclasses import dataclass

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import FencingToken, RefusalDetail
from rackhand.services.controller.access.types import Decision

DEADMAN_NS = 100_000_000


@dataclass(frozen=True)
class StreamSample:
    """A reference as it arrived, with the order and age its sender gave it."""

    token: FencingToken
    sequence: int | None = None
    stamp: int | None = None
    timeout_ns: int | None = None


class StreamGuard:
    """Keeps a reference alive for at most ``deadman_ns`` after its last refresh, and refuses late and replayed samples.

    A sample may ask for less time, never for more. Sequence and stamp grow within a lease and start again with the
    next. A stop is a barrier: samples that answer a state from before it are late.
    """

    def __init__(self, deadman_ns: int = DEADMAN_NS, max_age_ns: int = DEADMAN_NS) -> None:
        self._deadman_ns = deadman_ns
        self._max_age_ns = max_age_ns
        self._token: FencingToken | None = None
        self._sequence: int | None = None
        self._stamp: int | None = None
        self._barrier = 0
        self._deadline: int | None = None

    @property
    def alive(self) -> bool:
        """Whether a reference is in force (as of the last ``offer`` or ``expired``)."""
        return self._deadline is not None

    def offer(self, sample: StreamSample, now: int) -> Decision:
        """Accepts a sample, or refuses it as stale (412). A refused sample refreshes nothing."""
        if sample.token != self._token:
            self._token, self._sequence, self._stamp = sample.token, None, None
        late = self._lateness(sample, now)
        if late:
            return Decision(False, CrfCode.PreconditionFailed, RefusalDetail.STALE_SAMPLE, late)
        self._sequence = sample.sequence if sample.sequence is not None else self._sequence
        self._stamp = sample.stamp if sample.stamp is not None else self._stamp
        wanted = self._deadman_ns if sample.timeout_ns is None else sample.timeout_ns
        self._deadline = now + min(wanted, self._deadman_ns)
        return Decision(True)

    def expired(self, now: int) -> bool:
        """True once when the reference expires: it is zero from here on."""
        if self._deadline is None or now < self._deadline:
            return False
        self._deadline = None
        return True

    def stop(self, now: int) -> None:
        """A stop ends the reference at once."""
        self._deadline = None
        self._barrier = max(self._barrier, now)

    def _lateness(self, sample: StreamSample, now: int) -> str:
        if sample.sequence is not None and self._sequence is not None and sample.sequence <= self._sequence:
            return f"sequence {sample.sequence} after {self._sequence}"
        if sample.stamp is None:
            return ""
        if self._stamp is not None and sample.stamp < self._stamp:
            return f"stamp {sample.stamp} after {self._stamp}"
        if sample.stamp < self._barrier:
            return f"stamp {sample.stamp} is from before the stop at {self._barrier}"
        age = now - sample.stamp
        if abs(age) > self._max_age_ns:
            return f"stamp {sample.stamp} is {age / 1e6:.1f} ms old, at most {self._max_age_ns / 1e6:.0f}"
        return ""
