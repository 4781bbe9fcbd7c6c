"""What the simulator can refuse or find wrong."""

from __future__ import annotations

from collections.abc import Iterable

from rackhand.schemas.refusal import RefusalCode, RequestRefused


class PhysicsError(Exception):
    """The simulated state is not finite any more: the run is void and the service must end."""


def unknown(what: str, name: str, known: Iterable[str]) -> RequestRefused:
    """The refusal of a name that is not known, with those that are."""
    return RequestRefused(RefusalCode.NOT_FOUND, f"{what} {name!r} is not known; known: {sorted(known)}")
