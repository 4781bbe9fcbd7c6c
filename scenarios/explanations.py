"""Whether the answer of ``GET /chassis/moves/{id}/explain`` names what a scenario did."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from rackhand.worlds.scenario_model import Explained, NamedThing

Json = dict[str, Any]
SAME = 1e-6  # within which a measure is what was expected


def unexplained(expected: Explained, state: str, found: Json) -> Iterator[str]:
    """What the answer does not say, a sentence each."""
    if found["verdict"] != state:
        yield f"explain: the verdict is {found['verdict']!r}, expected {state!r}"
    if state == "failed" and not found["advice"]:
        yield "explain: there is no advice"
    for words in expected.words:
        if words not in found["cause"]:
            yield f"explain: the cause is {found['cause']!r}; expected {words!r} in it"
    for thing in expected.things:
        if not any(_is_named(thing, one) for one in found["things"]):
            yield f"explain names {_shown(found['things'])}; expected {thing.model_dump(exclude_none=True)}"
    measures = {one["name"]: one for one in found["measures"]}
    for name in expected.measures:
        if name not in measures:
            yield f"explain measures {sorted(measures) or 'nothing'}; expected {name!r}"
        elif not _misses(measures[name]):
            yield f"explain: {name} is {measures[name]['value']:g}, which is within what was expected"
    for one in found["things"]:
        if one["clearance"] is not None and one["needed"] is not None and one["clearance"] >= one["needed"] + SAME:
            yield f"explain: {_shown([one])} has the clearance {one['clearance']:g} m, and needs {one['needed']:g} m"


def _is_named(wanted: NamedThing, found: Json) -> bool:
    if (found["kind"], found["role"]) != (wanted.kind, wanted.role) or wanted.name not in (None, found["name"]):
        return False
    return wanted.at is None or math.dist(wanted.at, found["pos"]) <= wanted.within


def _misses(measure: Json) -> bool:
    """What was measured is not what was expected, where something was; a time that is up has reached its limit."""
    value, expected = measure["value"], measure["expected"]
    if expected is None:
        return True
    return bool(value >= expected if measure["unit"] == "s" else abs(value - expected) > SAME)


def _shown(things: list[Json]) -> str:
    texts = [f"{one['role']} {one['kind']} {one['name']!r} at {tuple(one['pos'])}" for one in things]
    return ", ".join(texts) or "nothing"
