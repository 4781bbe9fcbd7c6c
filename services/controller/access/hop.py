"""The last check before the joints."""

from __future__ import annotations

from rackhand.schemas.motion import FencingToken


class FencingGuard:
    """Lets only commands of the newest grant pass, each no older than the one before it.

    It stands wherever commands enter a process that moves joints: late and replayed samples are real on a network.
    Within an epoch a larger lease replaces a smaller one for good; an epoch once replaced never comes back. Stamps
    start anew with each lease, so a controller whose clock is set back (a simulation's reset) takes a new epoch.
    """

    def __init__(self) -> None:
        self._newest: FencingToken | None = None
        self._retired: set[str] = set()
        self._stamp = -1

    @property
    def newest(self) -> FencingToken | None:
        return self._newest

    def raise_to(self, token: FencingToken) -> bool:
        """Makes ``token`` the newest, so that no older one passes even before its first command. False if it is old."""
        newest = self._newest
        if token.epoch in self._retired or (newest and token.epoch == newest.epoch and token.lease < newest.lease):
            return False
        if newest and token.epoch != newest.epoch:
            self._retired.add(newest.epoch)
        if token != newest:
            self._newest, self._stamp = token, -1
        return True

    def admit(self, token: FencingToken, answers: int) -> bool:
        """Whether a command that answers the state stamped ``answers`` may reach the joints."""
        if not self.raise_to(token) or answers < self._stamp:
            return False
        self._stamp = answers
        return True
