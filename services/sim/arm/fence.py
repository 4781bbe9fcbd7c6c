"""The last check before an arm's joints: commands of a grant that a newer one replaced do not pass.

The controller holds to the same rule where commands leave it; the driver holds to it again, because what it hears
has come over a network, where late and replayed samples are real.
"""

from __future__ import annotations

from rackhand.schemas.motion import FencingToken


class FencingGuard:
    """Within an epoch a larger lease replaces a smaller one for good. An epoch heard for the first time replaces the
    one before it, which never comes back. Under one token no command may answer an older instant than the last did.
    """

    def __init__(self) -> None:
        self._newest: FencingToken | None = None
        self._retired: set[str] = set()
        self._answered = -1

    def admit(self, token: FencingToken, answers: int) -> bool:
        """Whether the command may pass; if so, its token is the newest from now on."""
        newest = self._newest
        if token.epoch in self._retired:
            return False
        if newest is None or token.epoch != newest.epoch:
            if newest is not None:
                self._retired.add(newest.epoch)
        elif token.lease < newest.lease or (token.lease == newest.lease and answers < self._answered):
            return False
        self._newest, self._answered = token, answers
        return True
