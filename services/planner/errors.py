"""Moves that fail, and a store that cannot be used; refused requests are ``schemas.refusal.RequestRefused``."""

from __future__ import annotations

from rackhand.schemas.fail_reasons import MoveFailReason


class MoveFailed(Exception):
    """A move cannot go on: the reason clients get as a number, and the text that says what, where and by how much."""

    def __init__(self, reason: MoveFailReason, text: str) -> None:
        super().__init__(f"{reason.rest_name}: {text}")
        self.reason = reason
        self.text = text


class StoreError(Exception):
    """The store file cannot be used: foreign, corrupt, newer, of another robot, or held by another planner.

    Nothing in the file was changed.
    """
