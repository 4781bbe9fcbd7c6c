"""Errors of calls on the bus."""

from __future__ import annotations

from rackhand.schemas.refusal import RefusalCode


class BusError(Exception):
    """Base class of the bus' errors."""


class Unavailable(BusError):
    """No server answers this query: it does not run, or it ended during the call."""


class CallTimeout(BusError):
    """The server runs but did not answer in time."""


class Refused(BusError):
    """The server refused the request. ``code`` and ``text`` are those of its ``Refusal``."""

    def __init__(self, code: RefusalCode, text: str) -> None:
        super().__init__(f"{code}: {text}")
        self.code = code
        self.text = text
