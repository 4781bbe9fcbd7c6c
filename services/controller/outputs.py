"""What a controller has to send, collected until the service takes it."""

from __future__ import annotations

from dataclasses import dataclass, field

from rackhand.schemas.motion import MotionDiagnostics, MotionEvent, MotionPath, MotionStatus
from rackhand.services.controller.access.types import AuditEntry


@dataclass
class ControllerOutput:
    """Each in order. ``replies``: tickets and their answers; ``streams``: status streams by session; ``errors``: what
    has failed inside, for the log."""

    replies: list[tuple[object, str]] = field(default_factory=list)
    events: list[MotionEvent] = field(default_factory=list)
    audit: list[AuditEntry] = field(default_factory=list)
    streams: list[tuple[str, str]] = field(default_factory=list)
    status: MotionStatus | None = None
    diagnostics: MotionDiagnostics | None = None
    path: MotionPath | None = None
    errors: list[BaseException] = field(default_factory=list)


class Outbox:
    """Holds the current ``output``; the parts of a controller write to it."""

    def __init__(self) -> None:
        self.output = ControllerOutput()

    def take(self) -> ControllerOutput:
        """Everything since the last call."""
        output, self.output = self.output, ControllerOutput()
        return output
