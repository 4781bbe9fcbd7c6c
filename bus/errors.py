"""What can go wrong with a call."""

from __future__ import annotations

from rackhand.schemas.refusal import RefusalCode


class BusError(Exception):
    """Base of all that the bus raises."""


class Unavailable(BusError):
    """Nobody answers this query: its server is not there, or died while it was asked."""


class CallTimeout(BusError):
    """The server is there but did not answer in time."""


class Refused(BusError):
    """The server refused the request. ``code`` and ``text`` are those of its ``Refusal``."""

    def __init__(self, code: RefusalCode, text: str) -> None:
        super().__init__(f"{code}: {text}")
        self.code = code
        self.text = text
