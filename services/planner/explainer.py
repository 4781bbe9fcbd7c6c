"""Why the running move waits or is slow, and why earlier ones failed: gathers evidence, keeps it, answers."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.base import Twist2
from rackhand.schemas.chassis import Costmap
from rackhand.schemas.explain import Evidence, ExplainMove, ExplainReply, Explanation, Thing
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import Move
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.behaviors.base import Status
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.moves.book import MoveBook
from rackhand.services.planner.moves.evidence import MoveTrace, SpeedLimit, Tick
from rackhand.services.planner.moves.explaining import cause_of, verdict_of
from rackhand.services.planner.moves.explanations import ExplanationRecords
from rackhand.services.planner.perception import things
from rackhand.services.planner.perception.costmap import cost_bytes
from rackhand.services.planner.planning.distance_grid import DistanceGrid

CUT_OUT = 4.0  # m to each side of the chassis, of the costmap that is kept
NOTICED = 0.1  # m beyond the clearance that is needed, within which a thing beside the chassis counts as in the way
_BLOCKED = frozenset(
    {
        Reason.PLANNING_TIMEOUT,
        Reason.MOVE_TIMEOUT,
        Reason.ROTATE_TIMEOUT,
        Reason.RACK_RETRY_COUNT_EXCEEDED,
        Reason.CHARGE_RETRY_COUNT_EXCEEDED,
        Reason.UNLOAD_POINT_OCCUPIED,
    }
)
"""Reasons of which something in the way may be the cause."""


class Explainer:
    """``begin``, ``note`` once a tick, ``end`` for each move; ``answer`` any time."""

    def __init__(self, motion: Motion, records: ExplanationRecords) -> None:
        self._motion, self._records = motion, records
        self._trace: MoveTrace | None = None

    def begin(self, stamp: int) -> None:
        self._trace = MoveTrace(stamp)

    def note(self, stamp: int, status: Status, measured: Twist2, commanded: Twist2, set_velocity: float) -> None:
        """Take one tick of the running move. ``set_velocity``: the forward velocity in m/s that clients allow."""
        if self._trace is None or self._motion.move is None:
            return
        pose, held_by = self._motion.perception.pose, self._motion.move.held_by
        limit = self._limit(pose, set_velocity)
        self._trace.note(Tick(stamp, pose, measured, commanded, held_by, status, limit))

    def end(self, stamp: int, move: Move, evidence: Evidence | None = None) -> None:
        """Keep the explanation of a move that has ended; of one that nothing held, in short."""
        explanation = self._explained(stamp, move, self._trace, evidence or Evidence())
        if explanation.verdict == "succeeded":
            explanation = explanation.model_copy(update={"costmap": None, "trace": _NO_TRACE, "paths": ()})
        self._trace = None
        self._records.save(explanation)

    def answer(self, request: ExplainMove, book: MoveBook, stamp: int) -> ExplainReply:
        """Raises ``RequestRefused`` (not_found)."""
        if request.id is None and book.last is None:
            raise RequestRefused(RefusalCode.NOT_FOUND, "there is no move yet")
        move = book.last if request.id is None and book.last is not None else book.get(request.id)
        if move.state == "moving":
            return ExplainReply(explanation=self._explained(stamp, move, self._trace, Evidence()))
        kept = self._records.get(move.id)
        # Of a move that a crash ended, or one of long ago, there is the record alone.
        return ExplainReply(explanation=kept or self._recorded(stamp, move))

    # -- in detail ---------------------------------------------------------------------------------------------------

    def _explained(self, stamp: int, move: Move, trace: MoveTrace | None, evidence: Evidence) -> Explanation:
        last = None if trace is None else trace.last
        pose = self._motion.perception.pose if last is None else last.pose
        held_by = None if last is None else last.held_by
        stuck = last is not None and last.status.stuck_state != "none"
        held = () if trace is None else trace.held()
        verdict = verdict_of(move, held_by, stuck, held, 0.0 if trace is None else trace.seconds)
        if not evidence.things and (stuck or move.fail_reason in _BLOCKED):
            evidence = evidence.model_copy(update={"things": self._in_the_way(last, pose)})
        cause, advice = cause_of(move, verdict, trace, held_by, evidence)
        return Explanation(
            stamp=stamp,
            move=move,
            verdict=verdict,
            cause=cause,
            advice=advice,
            evidence=evidence,
            held=held,
            duration=0.0 if trace is None else trace.seconds,
            driven=0.0 if trace is None else round(trace.driven, 3),
            pose=None if pose is None else se2.message(pose),
            footprint=self._outline(pose),
            trace=_NO_TRACE if trace is None else trace.rows(),
            paths=() if trace is None else trace.paths(),
            costmap=self._cut_out(stamp, pose),
        )

    def _recorded(self, stamp: int, move: Move) -> Explanation:
        verdict = verdict_of(move, None, False, (), 0.0)
        cause, advice = cause_of(move, verdict, None, None, Evidence())
        return Explanation(
            stamp=stamp, move=move, verdict=verdict, cause=cause, advice=advice, footprint=_NO_OUTLINE, trace=_NO_TRACE
        )

    def _limit(self, pose: Pose | None, set_velocity: float) -> SpeedLimit | None:
        """What keeps the chassis from its greatest speed here."""
        motion = self._motion
        allowed, own, costmap = (
            motion.settings.control.max_forward_velocity,
            motion.own_limits,
            motion.perception.costmap,
        )
        if own is None:
            return None
        zone = float("inf") if pose is None or costmap is None else costmap.speed_limit(pose)
        if zone < min(allowed, own.max_forward_velocity):
            return SpeedLimit(zone, f"a slow zone of {zone:.2f} m/s")
        if allowed >= own.max_forward_velocity or allowed == 0.0:
            return None
        if set_velocity <= allowed:
            setting = "control.max_forward_velocity"
            return SpeedLimit(allowed, f"the maximum forward velocity is set to {allowed:.2f} m/s", setting)
        setting = "weight_based_speed_limit.enable"
        return SpeedLimit(allowed, f"the load limits the forward velocity to {allowed:.2f} m/s", setting)

    def _in_the_way(self, last: Tick | None, pose: Pose | None) -> tuple[Thing, ...]:
        """What blocks the path, the turn or the chassis where it is."""
        costmap, footprint = self._motion.perception.costmap, self._motion.footprint
        if costmap is None or footprint is None or pose is None:
            return ()
        needed = float(self._motion.settings.path_margin)
        found = None
        if last is not None and len(last.status.path):
            found = things.on_path(costmap, footprint, last.status.path, needed)
        elif last is not None and last.status.stuck_state == "target_spin_stucked":
            found = things.beside_turn(costmap, footprint, pose)
        found = found or things.nearest_at(costmap, footprint, pose, needed)
        is_near = found is not None and found.clearance is not None and found.clearance < needed + NOTICED
        return (found,) if found is not None and is_near else ()

    def _outline(self, pose: Pose | None) -> np.ndarray:
        footprint = self._motion.footprint
        if footprint is None or pose is None:
            return _NO_OUTLINE
        return se2.transformed(pose, footprint.polygon).astype(np.float32)

    def _cut_out(self, stamp: int, pose: Pose | None) -> Costmap | None:
        costmap, footprint = self._motion.perception.costmap, self._motion.footprint
        if costmap is None or footprint is None or pose is None:
            return None
        g = costmap.near.geometry
        (r0, c0), (r1, c1) = g.cell(*(pose[:2] - CUT_OUT)), g.cell(*(pose[:2] + CUT_OUT))
        rows, columns = slice(max(r0, 0), min(r1, g.rows)), slice(max(c0, 0), min(c1, g.columns))
        part = costmap.near.distance[rows, columns]
        if part.size == 0:
            return None
        corner = g.x + columns.start * g.resolution, g.y + rows.start * g.resolution
        cut = DistanceGrid(part, Geometry(*corner, g.resolution, *part.shape))
        cost = cost_bytes(cut, footprint.inscribed, self._motion.settings.inflation_radius)
        return Costmap(
            stamp=stamp, origin=corner, resolution=g.resolution, columns=part.shape[1], cost=cost.reshape(-1)
        )


_NO_TRACE = np.empty((0, 8), dtype=np.float32)
_NO_OUTLINE = np.empty((0, 2), dtype=np.float32)
