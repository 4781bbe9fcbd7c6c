"""Moves that fail, and a store that cannot be used; refused requests are ``schemas.refusal.RequestRefused``."""

from __future__ import annotations

from collections.abc import Sequence

from rackhand.schemas.explain import Evidence, Measure, Thing
from rackhand.schemas.fail_reasons import MoveFailReason


class MoveFailed(Exception):
    """A move cannot go on: the reason clients get as a number, the text that says what, where and by how much, and what
    of it is known as data."""

    def __init__(self, reason: MoveFailReason, text: str, evidence: Evidence | None = None) -> None:
        super().__init__(f"{reason.rest_name}: {text}")
        self.reason = reason
        self.text = text
        self.evidence = evidence or Evidence()

    def about(self, *things: Thing | None, measures: Sequence[Measure] = ()) -> MoveFailed:
        """The same failure, of which these are known beside what was known before; without those that are None."""
        known = self.evidence
        found = (*known.things, *(thing for thing in things if thing is not None))
        return MoveFailed(self.reason, self.text, Evidence(things=found, measures=(*known.measures, *measures)))


class StoreError(Exception):
    """The store file cannot be used: foreign, corrupt, newer, of another robot, or held by another planner.

    Nothing in the file was changed.
    """


def elapsed(what: str, seconds: float, most: float) -> Measure:
    """How long something lasted, beside the time after which a move fails by it, as evidence."""
    return Measure(name=what, value=round(seconds, 2), expected=most, unit="s")
