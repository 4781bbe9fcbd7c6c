"""What a command that is executed in the protocol layer works with."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from rackhand.schemas.motion import RobotConfiguration
from rackhand.services.controller.access.access import Access
from rackhand.services.controller.access.types import AccessInput, Caller, Decision, Outcome
from rackhand.services.controller.protocol.answers import lease_extras
from rackhand.services.controller.protocol.status_stream import StatusStreams


@dataclass
class RequestContext:
    """One request's. ``named``: its client gave a name. ``now``: monotonic nanoseconds. ``outcomes``: what priority
    access has decided for this request so far, in order."""

    access: Access
    streams: StatusStreams
    arm: RobotConfiguration
    caller: Caller
    session: str
    named: bool
    now: int
    outcomes: list[Outcome] = field(default_factory=list)

    @property
    def strict_crf(self) -> bool:
        return self.access.config.strict_crf

    def handle(self, happened: AccessInput) -> Decision:
        """Hands ``happened`` to priority access and keeps its outcome."""
        self.outcomes.append(self.access.handle(happened, self.now))
        return self.outcomes[-1].decision

    def lease(self, decision: Decision) -> dict[str, Any]:
        """Extra fields of the reply. Clients without a name get CRF's reply to the letter."""
        return lease_extras(decision) if self.named else {}
