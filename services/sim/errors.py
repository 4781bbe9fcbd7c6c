"""What the simulator can refuse or find wrong."""

from __future__ import annotations

from collections.abc import Iterable


class WorldFileError(Exception):
    """A world, profile or data file is wrong; the text says which file, where in it, and what was expected."""


class PhysicsError(Exception):
    """The simulated state is not finite any more: the run is void and the service must end."""


class RequestRefused(Exception):
    """A request to the world cannot be met. ``code`` is one of ``rackhand.schemas.chassis.Refusal``."""

    def __init__(self, code: str, text: str) -> None:
        super().__init__(f"{code}: {text}")
        self.code = code
        self.text = text


def unknown(what: str, name: str, known: Iterable[str]) -> RequestRefused:
    """The refusal of a name that is not known, with those that are."""
    return RequestRefused("not_found", f"{what} {name!r} is not known; known: {sorted(known)}")
