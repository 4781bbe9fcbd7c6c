"""What a run of a scenario showed, judged against what its file expects."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

from rackhand.scenarios.explanations import unexplained
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.worlds.scenario_model import Expectation

Json = dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """Of the judged move: its REST object, the newest frame of ``/planning_state``, the seconds of simulation time from
    its request to its end (None if it did not end in time), the contacts of the robot by then, and the answer of
    ``explain`` where the scenario expects something of it.
    """

    move: Json
    frame: Json
    took: float | None
    contacts: tuple[str, ...] = ()
    explained: Json = field(default_factory=dict)


@dataclass(frozen=True)
class Verdict:
    """``problems``: all that was not as expected, empty if the scenario passed. ``took`` in simulation seconds, of the
    judged move; ``simulated`` and ``wall`` of the whole scenario.
    """

    scenario: str
    world: str
    seed: int
    state: str
    fail_reason: int
    fail_message: str
    took: float | None
    contacts: int
    simulated: float
    wall: float
    problems: tuple[str, ...] = field(default=())

    @property
    def passed(self) -> bool:
        return not self.problems

    @property
    def reason_name(self) -> str:
        return MoveFailReason(self.fail_reason).rest_name

    def as_json(self) -> Json:
        return asdict(self) | {"passed": self.passed, "fail_reason_str": MoveFailReason(self.fail_reason).rest_string}


def judge(expect: Expectation, outcome: Outcome) -> tuple[str, ...]:
    """What is not as expected, a sentence each."""
    return tuple(_problems(expect, outcome))


def _problems(expect: Expectation, outcome: Outcome) -> Iterable[str]:
    move, frame, wanted = outcome.move, outcome.frame, expect.reason
    if outcome.took is None:
        yield f"the move is still {move['state']}; expected {expect.state} within {expect.within:g} s"
        return
    if outcome.took > expect.within:
        yield f"the move ended after {outcome.took:.1f} s; expected at most {expect.within:g} s"
    found = (move["state"], move["fail_reason"])
    if found != (expect.state, int(wanted)):
        yield (
            f"the move {move['state']} with {move['fail_reason']} ({move['fail_message']}); "
            f"expected {expect.state} with {int(wanted)} {wanted.rest_name}"
        )
        return
    if move["fail_reason_str"] != wanted.rest_string:
        yield f"fail_reason_str of REST is {move['fail_reason_str']!r}; expected {wanted.rest_string!r}"
    shown = tuple(frame.get(key) for key in ("action_id", "move_state", "fail_reason", "fail_reason_str"))
    should = (move["id"], expect.state, int(wanted), wanted.topic_string)
    if shown != should:
        yield f"/planning_state shows {shown}; expected {should}"
    for part in expect.text:
        if part not in move["fail_message"]:
            yield f"fail_message is {move['fail_message']!r}; expected {part!r} in it"
    if len(outcome.contacts) > expect.contacts:
        touched = ", ".join(sorted(set(outcome.contacts)))
        yield f"{len(outcome.contacts)} contacts, with {touched}; expected at most {expect.contacts}"
    if expect.explain is not None:
        yield from unexplained(expect.explain, expect.state, outcome.explained)


def table(verdicts: Sequence[Verdict]) -> str:
    """Columns as wide as their widest cell; below it what was not as expected."""
    header = ("scenario", "verdict", "state", "code", "reason", "took", "simulated", "wall")
    rows = [header, *(_row(verdict) for verdict in verdicts)]
    widths = [max(len(row[column]) for row in rows) for column in range(len(header))]
    lines = ["  ".join(f"{c:<{w}}" for c, w in zip(row, widths, strict=True)).rstrip() for row in rows]
    lines += [f"{verdict.scenario}: {problem}" for verdict in verdicts for problem in verdict.problems]
    return "\n".join(lines)


def _row(verdict: Verdict) -> tuple[str, ...]:
    return (
        verdict.scenario,
        "passed" if verdict.passed else "FAILED",
        verdict.state,
        str(verdict.fail_reason),
        verdict.reason_name,
        "–" if verdict.took is None else f"{verdict.took:.1f} s",
        f"{verdict.simulated:.0f} s",
        f"{verdict.wall:.1f} s",
    )
