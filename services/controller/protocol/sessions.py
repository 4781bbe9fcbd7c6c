"""Which sessions a client uses, and what a client without a name is called."""

from __future__ import annotations

import hashlib
from collections import OrderedDict

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.motion import CONNECTION

MAX_CONNECTIONS = 64  # of one client; more are not remembered


class Sessions:
    """The newest ``limit`` clients and their sessions.

    A client is gone when the last of its connections is closed. Sessions that are no connections (HTTP, the bus) are
    never closed: of those only the one that the client has used last counts.

    A session names a connection, and anyone who knows it could act for its client. A client without a name of its own
    is therefore called by its session's ``alias`` wherever others can read it.
    """

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._used: OrderedDict[str, list[str]] = OrderedDict()  # of each client, the last used at the end

    def remember(self, client: str, session: str) -> None:
        used = self._used.setdefault(client, [])
        self._used.move_to_end(client)
        if not used or used[-1] != session:
            others = [each for each in used if each != session and each.startswith(CONNECTION)]
            used[:] = [*others[1 - MAX_CONNECTIONS :], session]
        if len(self._used) > self._limit:
            self._used.popitem(last=False)

    def forget(self, session: str) -> list[str]:
        """The clients that are gone with ``session``: one that is connected through another, or has come back through
        another, is not."""
        gone = []
        for client, used in self._used.items():
            if session in used:
                used.remove(session)
                if not used:
                    gone.append(client)
        for client in gone:
            del self._used[client]
        if (nameless := alias(session)) not in gone:
            gone.append(nameless)  # it may have been dropped for newer clients
        return gone

    def recipient(self, client: str) -> str:
        """Where an event to ``client`` goes: a client with a name, or the session of one without."""
        used = self._used.get(client) if client.startswith(crf.ALIAS_MARK) else None
        return used[-1] if used else client


def alias(session: str) -> str:
    """The public name of a client without a name. The session cannot be found from it."""
    return crf.ALIAS_MARK + hashlib.blake2s(session.encode(errors="surrogatepass"), digest_size=8).hexdigest()
