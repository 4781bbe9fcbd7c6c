"""The fencing check of joint commands, used by both ends: the controller that sends them and the driver that obeys."""

from __future__ import annotations

from rackhand.schemas.motion import FencingToken


class FencingGuard:
    """Admits only commands of the newest lease, each answering a state no older than the one before it.

    It belongs wherever commands enter a process that moves joints: late and replayed samples are real on a network.
    Within an epoch a larger lease replaces a smaller one for good; an epoch once replaced is never admitted again.
    Stamps start over with each lease, so a controller whose clock is set back (a simulation's reset) takes a new epoch.
    Source of the scheme: Kleppmann 2016, "How to do distributed locking" (fencing tokens).
    """

    def __init__(self) -> None:
        self._newest: FencingToken | None = None
        self._retired: set[str] = set()
        self._stamp = -1

    @property
    def newest(self) -> FencingToken | None:
        return self._newest

    def raise_to(self, token: FencingToken) -> bool:
        """Make ``token`` the newest, so that no older one passes even before its first command. False if it is old."""
        newest = self._newest
        if token.epoch in self._retired or (newest and token.epoch == newest.epoch and token.lease < newest.lease):
            return False
        if newest and token.epoch != newest.epoch:
            self._retired.add(newest.epoch)
        if token is not newest and token != newest:
            self._newest, self._stamp = token, -1
        return True

    def admit(self, token: FencingToken, answers: int) -> bool:
        """Whether a command that answers the state stamped ``answers`` (ns) may reach the joints."""
        if not self.raise_to(token) or answers < self._stamp:
            return False
        self._stamp = answers
        return True
