"""Who is connected to which arm, and what the arms' controllers tell them."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager
from typing import Any

from rackhand.bus import Event, Sample
from rackhand.schemas import topics
from rackhand.services.gateway.crf.session import Ask, Session
from rackhand.services.gateway.crf.text import event_text

SUBSCRIPTIONS: tuple[topics.Topic[Any], ...] = (topics.MOTION_EVENT, topics.MOTION_STREAM)


class MotionHub:
    """``gone(arm, session)`` tells an arm's controller that a connection is closed."""

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

    def on_message(self, event: Event) -> None:
        if not isinstance(event, Sample) or event.robot not in self._sessions:
            return
        sessions = self._sessions[event.robot]
        if event.topic is topics.MOTION_STREAM:
            if (session := sessions.get(event.message.session)) is not None:
                session.tell_status(event.message.text)
        elif event.topic is topics.MOTION_EVENT and sessions:
            text = event_text(event.message.name, event.message.info)
            for session in sessions.values():
                session.tell_event(event.message, text)

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
