"""A move explained in words: what it is about, where, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence

from rackhand.schemas.explain import Evidence, Held, Verdict
from rackhand.schemas.moves import Move
from rackhand.services.planner.moves.advice import advice_for
from rackhand.services.planner.moves.evidence import MoveTrace

SLOW_AFTER = 3.0  # s held, from which on a move counts as slow
SLOW_SHARE = 0.2  # of its time


def verdict_of(move: Move, held_by: str | None, stuck: bool, held: Sequence[Held], seconds: float) -> Verdict:
    """How the move is or was. ``held``: what held it in all, ``seconds``: its duration."""
    if move.state == "moving":
        if held_by is not None:
            return "waiting"
        return "stuck" if stuck else "moving"
    if move.state == "failed":
        return "failed"
    if move.state == "cancelled":
        return "cancelled"
    return "slow" if is_slow(held, seconds) else "succeeded"


def is_slow(held: Sequence[Held], seconds: float) -> bool:
    total = sum(one.seconds for one in held)
    return total >= SLOW_AFTER and total >= SLOW_SHARE * seconds


def cause_of(
    move: Move, verdict: Verdict, trace: MoveTrace | None, held_by: str | None, evidence: Evidence
) -> tuple[str, str]:
    """The cause, and what to do about it."""
    held = () if trace is None else trace.held()
    if verdict in ("failed", "cancelled"):
        words = [move.fail_message or f"the move {move.state}", *_sentences(evidence)]
        return _joined(words), advice_for(move.fail_reason, move.fail_message) if verdict == "failed" else ""
    if verdict == "waiting":
        return f"the move waits: {held_by}", advice_for(0, held_by or "")
    if verdict == "stuck":
        return _joined(["no progress", *_sentences(evidence)]), "remove what is in the way, or cancel the move"
    took = "" if trace is None else f" after {trace.seconds:.1f} s and {trace.driven:.2f} m"
    if verdict == "moving":
        return _joined([f"the move drives{took}", *map(_held, held[:3])]), ""
    if verdict == "slow":
        return _joined([f"the move succeeded{took}, and was slow", *map(_held, held[:3])]), advice_for(0, held[0].by)
    short = [_held(one) for one in held[:3] if one.seconds >= 0.5]
    return _joined([f"the move succeeded{took}", *(short or ["nothing held it"])]), ""


def _sentences(evidence: Evidence) -> list[str]:
    return [thing.sentence for thing in evidence.things]


def _held(held: Held) -> str:
    return f"held for {held.seconds:.1f} s by: {held.by}"


def _joined(words: Sequence[str]) -> str:
    return "; ".join(words)
