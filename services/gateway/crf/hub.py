"""The clients connected to each arm, and the events and streams of its controller for them."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager

from rackhand.schemas.motion import MotionEvent, MotionStream
from rackhand.services.gateway.crf.session import Ask, Session
from rackhand.services.gateway.crf.text import event_text


class MotionHub:
    """``gone(arm, session)`` is called when a connection to an arm is closed."""

    def __init__(
        self, arms: Iterable[str] = (), gone: Callable[[str, str], None] = lambda _arm, _session: None
    ) -> None:
        self.arms = tuple(dict.fromkeys(arms))
        self.gone = gone
        self._sessions: dict[str, dict[str, Session]] = {arm: {} for arm in self.arms}
        self._key = secrets.token_bytes(32)

    def http_session(self, client: str) -> str:
        """The session of a client over HTTP: the same for the same client, and not to be guessed from its name."""
        return hashlib.blake2s(client.encode(), key=self._key, digest_size=24).hexdigest()

    def on_stream(self, arm: str, stream: MotionStream) -> None:
        """A status of the stream that one session has started."""
        if (session := self._sessions.get(arm, {}).get(stream.session)) is not None:
            session.tell_status(stream.text)

    def on_event(self, arm: str, event: MotionEvent) -> None:
        """An event of an arm; each session decides whether it concerns it."""
        if sessions := self._sessions.get(arm):
            text = event_text(event.name, event.info)
            for session in sessions.values():
                session.tell_event(event, text)

    @asynccontextmanager
    async def session(self, arm: str, ask: Ask) -> AsyncIterator[Session]:
        """A new connection to an arm, while it lasts."""
        session = Session(ask)
        self._sessions[arm][session.name] = session
        try:
            yield session
        finally:
            del self._sessions[arm][session.name]
            self.gone(arm, session.name)
