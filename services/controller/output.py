"""What comes of what happened to a controller, until somebody takes it."""

from __future__ import annotations

from dataclasses import dataclass, field

from rackhand.schemas.motion import MotionDiagnostics, MotionEvent, MotionPath, MotionStatus
from rackhand.services.controller.access.types import AuditEntry


@dataclass
class Output:
    """Each in order. ``replies``: tickets and their answers; ``streams``: status streams by session."""

    replies: list[tuple[object, str]] = field(default_factory=list)
    events: list[MotionEvent] = field(default_factory=list)
    audit: list[AuditEntry] = field(default_factory=list)
    streams: list[tuple[str, str]] = field(default_factory=list)
    status: MotionStatus | None = None
    diagnostics: MotionDiagnostics | None = None
    path: MotionPath | None = None
    errors: list[BaseException] = field(default_factory=list)
