"""What a search in a scan found in place of what it looked for."""

from __future__ import annotations

from typing import NamedTuple

from rackhand.schemas.explain import Measure, Thing


class Miss(NamedTuple):
    """In words, and as evidence. Things are in the frame of the search, which is that of the map for who explains."""

    text: str
    things: tuple[Thing, ...] = ()
    measures: tuple[Measure, ...] = ()
