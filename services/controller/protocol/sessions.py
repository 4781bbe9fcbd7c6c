"""Which session a client was last seen on, and what a client without a name is called."""

from __future__ import annotations

import hashlib
from collections import OrderedDict

from rackhand.schemas import crf_requests as crf


class Sessions:
    """The newest ``limit`` clients and their sessions.

    A session names a connection, and anyone who knows it could act for its client. A client without a name of its own
    is therefore called by its session's ``alias`` wherever others can read it.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._last: OrderedDict[str, str] = OrderedDict()

    def remember(self, client: str, session: str) -> None:
        self._last[client] = session
        self._last.move_to_end(client)
        if len(self._last) > self._limit:
            self._last.popitem(last=False)

    def forget(self, session: str) -> list[str]:
        """The clients that are gone with ``session``: a client that has come back through another one is not."""
        gone = [client for client, last in self._last.items() if last == session]
        for client in gone:
            del self._last[client]
        if (nameless := alias(session)) not in gone:
            gone.append(nameless)  # it may have been dropped for newer clients
        return gone

    def recipient(self, client: str) -> str:
        """Where an event to ``client`` goes: a client with a name, or the session of one without."""
        return self._last.get(client, client) if client.startswith(crf.ALIAS_MARK) else client


def alias(session: str) -> str:
    """The public name of a client without a name. The session cannot be found from it."""
    return crf.ALIAS_MARK + hashlib.blake2s(session.encode(errors="surrogatepass"), digest_size=8).hexdigest()
