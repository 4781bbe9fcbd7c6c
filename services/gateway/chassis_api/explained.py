"""The body of ``GET /chassis/moves/{id}/explain``. Metres, radians, seconds, map frame."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from pydantic import BaseModel, Field

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Costmap
from rackhand.schemas.explain import Explanation, Held, Measure, PastPath, Role, Thing, ThingKind, Verdict
from rackhand.schemas.websocket import PoseFrame, Xy
from rackhand.services.gateway.chassis_api.models import fail_reason
from rackhand.services.gateway.ws.files import grey_png


class ExplainedThing(BaseModel):
    """`role`: it `blocks` the move, was `expected` there, or was `seen`. `clearance`: metres between it and the
    footprint of the robot at `at`, negative where they overlap; `needed`: what the robot must have there."""

    role: Role
    kind: ThingKind
    name: str
    pos: Xy
    clearance: float | None
    needed: float | None
    at: PoseFrame | None


class ExplainedMeasure(BaseModel):
    """What was measured, and what was expected or allowed; `setting`: the one in `/system/settings` that says so."""

    name: str
    value: float
    expected: float | None
    unit: str
    setting: str


class ExplainedHold(BaseModel):
    """What held the move, for how many seconds in all."""

    by: str
    seconds: float
    setting: str


class ExplainedTick(BaseModel):
    """`t`: seconds before the end of the move, negative. `velocity` and `command`: m/s and rad/s."""

    t: float
    pos: Xy
    ori: float
    velocity: Xy
    command: Xy


class ExplainedPath(BaseModel):
    """A path planned at `t`: rows x, y, yaw."""

    t: float
    positions: list[tuple[float, float, float]]


class ExplainedCostmap(BaseModel):
    """8-bit grey PNG, row 0 at the top; `origin` is the lower-left corner. 0 free, 253 too close, 254 blocked."""

    resolution: float
    size: tuple[int, int]
    origin: Xy
    data: str


class MoveExplained(BaseModel):
    """A move in words, and the evidence."""

    id: int
    type: str
    state: str
    verdict: Verdict = Field(examples=["failed"])
    cause: str
    advice: str
    fail_reason: int
    fail_reason_str: str
    duration: float
    driven: float
    things: list[ExplainedThing]
    measures: list[ExplainedMeasure]
    held: list[ExplainedHold]
    pose: PoseFrame | None
    footprint: list[Xy]
    costmap: ExplainedCostmap | None
    trace: list[ExplainedTick]
    paths: list[ExplainedPath]
    download_url: str
    recording_url: str


def explained(explanation: Explanation, root: str) -> MoveExplained:
    """``root``: of the API, for URLs."""
    move = explanation.move
    return MoveExplained(
        id=move.id,
        type=move.type,
        state=move.state,
        verdict=explanation.verdict,
        cause=explanation.cause,
        advice=explanation.advice,
        fail_reason=move.fail_reason,
        fail_reason_str=fail_reason(move.fail_reason).rest_string,
        duration=round(explanation.duration, 2),
        driven=explanation.driven,
        things=[_thing(thing) for thing in explanation.evidence.things],
        measures=[_measure(measure) for measure in explanation.evidence.measures],
        held=[_held(held) for held in explanation.held],
        pose=_pose(explanation.pose),
        footprint=[_xy(corner) for corner in explanation.footprint],
        costmap=None if explanation.costmap is None else _costmap(explanation.costmap),
        trace=[_tick(row) for row in explanation.trace],
        paths=[_path(path, explanation.stamp) for path in explanation.paths],
        download_url=f"{root}/chassis/moves/{move.id}/explain/download",
        recording_url=f"{root}/chassis/moves/{move.id}/explain/download.rrd",
    )


def _thing(thing: Thing) -> ExplainedThing:
    return ExplainedThing(
        role=thing.role,
        kind=thing.kind,
        name=thing.name,
        pos=(thing.x, thing.y),
        clearance=thing.clearance,
        needed=thing.needed,
        at=_pose(thing.at),
    )


def _measure(measure: Measure) -> ExplainedMeasure:
    return ExplainedMeasure(**measure.model_dump())


def _held(held: Held) -> ExplainedHold:
    return ExplainedHold(**held.model_dump())


def _pose(pose: Pose2 | None) -> PoseFrame | None:
    return None if pose is None else PoseFrame(pos=(round(pose.x, 4), round(pose.y, 4)), ori=round(pose.yaw, 4))


def _xy(values: Any) -> Xy:
    return round(float(values[0]), 4), round(float(values[1]), 4)


def _tick(row: Any) -> ExplainedTick:
    t, x, y, yaw, *twists = row
    return ExplainedTick(
        t=round(float(t), 3), pos=_xy((x, y)), ori=round(float(yaw), 4), velocity=_xy(twists), command=_xy(twists[2:])
    )


def _path(path: PastPath, stamp: int) -> ExplainedPath:
    rows = [(round(float(x), 3), round(float(y), 3), round(float(yaw), 3)) for x, y, yaw in path.poses]
    return ExplainedPath(t=round((path.stamp - stamp) / 1e9, 3), positions=rows)


def _costmap(costmap: Costmap) -> ExplainedCostmap:
    cells = costmap.cost.reshape(-1, costmap.columns)
    return ExplainedCostmap(
        resolution=costmap.resolution,
        size=(costmap.columns, len(cells)),
        origin=(round(costmap.origin[0], 4), round(costmap.origin[1], 4)),
        data=base64.b64encode(grey_png(np.flipud(cells))).decode(),
    )
