"""A query as its server sees it."""

from __future__ import annotations

from typing import Any, Generic, TypeVar

import zenoh

from rackhand.bus.log import get_logger
from rackhand.schemas.base import Message
from rackhand.schemas.codec import MalformedMessage, codec_for
from rackhand.schemas.refusal import Refusal, RefusalCode
from rackhand.schemas.topics import Query

log = get_logger(__name__)

Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)


class Request(Generic[Q, R]):
    """A query that waits for its one answer: ``reply`` or ``refuse``. Dropped unanswered, it is refused as internal."""

    def __init__(self, query: Query[Q, R], robot: str, message: Q, pending: zenoh.Query) -> None:
        self.query = query
        self.robot = robot
        self.message = message
        self._pending: zenoh.Query | None = pending

    def reply(self, message: R) -> None:
        codec = codec_for(type(message))
        try:
            payload = codec.dumps(message)
        except MalformedMessage as error:
            return self.refuse(RefusalCode.INTERNAL, str(error))
        if pending := self._take():
            with pending:
                pending.reply(pending.key_expr, payload, encoding=codec.encoding)
        return None

    def refuse(self, code: RefusalCode, text: str) -> None:
        if pending := self._take():
            refuse(pending, code, text)

    def _take(self) -> zenoh.Query | None:
        pending, self._pending = self._pending, None
        return pending

    def __del__(self) -> None:
        self.refuse(RefusalCode.INTERNAL, "the service stopped before it answered")


def refuse(pending: Any, code: RefusalCode, text: str) -> None:
    """Send a refusal; the caller or the session may be gone."""
    codec = codec_for(Refusal)
    try:
        with pending:
            pending.reply_err(codec.dumps(Refusal(code=code, text=text)), encoding=codec.encoding)
    except zenoh.ZError:
        log.debug("refusal not sent: the caller or the session is closed", code=code)
