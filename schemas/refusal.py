"""Why a request on the bus was refused: the one error body of every query, and the exception that servers raise."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from pydantic import Field

from rackhand.schemas.base import Message


class RefusalCode(StrEnum):
    """The kind of a refusal; on the wire, its string.

    ``NOT_FOUND``: nothing has that id or name. ``INVALID``: well typed, but a value makes no sense. ``PRECONDITION``:
    not in the present state. ``MALFORMED``: the bytes are not the request model. ``UNAVAILABLE``: something the server
    needs is not running, or too many requests wait. ``TIMEOUT``: the server gave up waiting. ``INTERNAL``: a fault of
    the server itself.
    """

    NOT_FOUND = "not_found"
    INVALID = "invalid"
    PRECONDITION = "precondition"
    MALFORMED = "malformed"
    UNAVAILABLE = "unavailable"
    TIMEOUT = "timeout"
    INTERNAL = "internal"


class Refusal(Message):
    """Why a request was refused. The text says what, where, and what was expected."""

    code: Annotated[RefusalCode, Field(strict=False)]
    text: str


class RequestRefused(Exception):
    """Raised by a server that does not carry a request out; its caller on the bus gets the same code and text."""

    def __init__(self, code: RefusalCode, text: str) -> None:
        super().__init__(f"{code}: {text}")
        self.code = code
        self.text = text
