"""Moves that fail, and a store that cannot be used; refused requests are ``schemas.refusal.RequestRefused``."""

from __future__ import annotations

from rackhand.schemas.explain import Evidence
from rackhand.schemas.fail_reasons import MoveFailReason


class MoveFailed(Exception):
    """A move cannot go on: the reason clients get as a number, the text that says what, where and by how much, and what
    of it is known as data."""

    def __init__(self, reason: MoveFailReason, text: str, evidence: Evidence | None = None) -> None:
        super().__init__(f"{reason.rest_name}: {text}")
        self.reason = reason
        self.text = text
        self.evidence = evidence or Evidence()


class StoreError(Exception):
    """The store file cannot be used: foreign, corrupt, newer, of another robot, or held by another planner.

    Nothing in the file was changed.
    """
