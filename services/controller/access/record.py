"""Collects what follows from one input of priority access: motion effects, events, lines of the audit log."""

from __future__ import annotations

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import ControlInfo, EventName, FencingToken
from rackhand.services.controller.access.entries import Entry
from rackhand.services.controller.access.types import (
    AuditEntry,
    Caller,
    ControlEvent,
    Decision,
    MotionEffect,
    Outcome,
    StopKind,
)


class OutcomeRecord:
    """``token`` and ``now`` are those of the machine at the moment of each entry; the machine keeps them current."""

    def __init__(self, epoch: str) -> None:
        self.token = FencingToken(epoch=epoch, lease=0)
        self.now = 0
        self._motion: list[MotionEffect] = []
        self._events: list[ControlEvent] = []
        self._audit: list[AuditEntry] = []

    def next_lease(self) -> None:
        """A grant or a loss: tokens of before are void."""
        self.token = FencingToken(epoch=self.token.epoch, lease=self.token.lease + 1)

    def motion(self, effect: MotionEffect) -> None:
        self._motion.append(effect)

    def event(
        self,
        name: EventName,
        to: str,
        about: Entry | None,
        by: str | None = None,
        by_priority: int | None = None,
        reason: str | None = None,
        kind: StopKind | None = None,
    ) -> None:
        """``to`` empty: for everybody. ``about``: the holder that the event is about, if there is one."""
        info = ControlInfo(
            client=about.client if about else "",
            priority=about.priority if about else 0,
            lease_id=self.token.lease,
            epoch=self.token.epoch,
            by=by,
            by_priority=by_priority,
            reason=reason,
            kind=kind,
        )
        self._events.append(ControlEvent(name, to, info))

    def audit(self, action: str, caller: Caller, priority: int, text: str = "", code: CrfCode = CrfCode.OK) -> None:
        self._audit.append(
            AuditEntry(
                monotonic_ns=self.now,
                action=action,
                client=caller.client,
                user=caller.user,
                role=caller.role,
                priority=priority,
                epoch=self.token.epoch,
                lease_id=self.token.lease,
                request_id=caller.request_id,
                code=int(code),
                text=text,
            )
        )

    def refused(self, caller: Caller, action: str, priority: int, refusal: Decision) -> Decision:
        """Writes the refusal to the audit log and returns it."""
        self.audit(action, caller, priority, refusal.text, refusal.code)
        return refusal

    def take(self, decision: Decision) -> Outcome:
        """Everything since the last call, with ``decision``."""
        outcome = Outcome(tuple(self._motion), tuple(self._events), tuple(self._audit), decision=decision)
        self._motion, self._events, self._audit = [], [], []
        return outcome
