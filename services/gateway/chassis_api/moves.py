"""``/chassis/moves``: create, list, look at, cancel, pause, resume."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import JSONResponse, Response

from rackhand.bus import Unavailable
from rackhand.schemas import topics
from rackhand.schemas.explain import ExplainMove, MoveRecording, RecordMove
from rackhand.schemas.moves import CancelMove, ClearMoves, CreateMove, GetMove, ListMoves, Move, MoveRequest, PauseMove
from rackhand.schemas.service import CELL
from rackhand.services.gateway.chassis_api.explained import MoveExplained, explained
from rackhand.services.gateway.chassis_api.models import (
    MAX_ID,
    MoveBody,
    MoveChange,
    MoveChangeBody,
    MoveChanged,
    MoveFull,
    MoveShort,
)
from rackhand.services.gateway.context import Context, Gateway, root_of
from rackhand.services.gateway.http.errors import failures, not_found, unavailable

router = APIRouter(prefix="/chassis/moves", tags=["moves"])

RECORDING_TIMEOUT = 10.0  # s; the viewer has the lowest priority of the cell
NO_VIEWER = (
    "no viewer runs in this cell, and it makes the recording: start one with `python -m rackhand.services.viewer`, "
    "or the cell without --no-viewer"
)

MoveId = Annotated[int, Path(ge=0, le=MAX_ID, description="the id that POST returned")]


@router.post("", status_code=201, responses=failures(400, 413, 503))
async def create_move(body: MoveBody, gateway: Gateway) -> MoveFull:
    """Start a move; a running one is cancelled. There is no queue.

    A well-formed target that cannot be reached is accepted; the move then fails with the reason.
    """
    move = await _one(gateway, MoveRequest(request=CreateMove(move=body.to_message())))
    # Some clients subscribe only now, and take the first final state they receive for that of their move.
    await gateway.hub.wait_for_move(move.id, gateway.settings.planning_state_timeout)
    return MoveFull.of(move)


@router.get("", responses=failures(400, 503))
async def list_moves(
    gateway: Gateway,
    offset: Annotated[int, Query(ge=0, le=MAX_ID, description="skip this many of the newest")] = 0,
    limit: Annotated[int | None, Query(ge=1, le=MAX_ID, description="at most this many; all if not given")] = None,
) -> list[MoveShort]:
    """All moves, newest first, without their targets."""
    reply = await gateway.ask(topics.MOVES, MoveRequest(request=ListMoves(offset=offset, limit=limit)))
    return [MoveShort.of(move) for move in reply.moves]


@router.delete("", status_code=204, responses=failures(503))
async def delete_all_moves(gateway: Gateway) -> None:
    """Forget all moves that have ended. Ids are not used again."""
    await gateway.ask(topics.MOVES, MoveRequest(request=ClearMoves()))


@router.get("/current", responses=failures(404, 503))
async def current_move(gateway: Gateway) -> MoveFull:
    """The running move; 404 as soon as it has ended."""
    return MoveFull.of(await _one(gateway, MoveRequest(request=GetMove())))


@router.get("/latest", include_in_schema=False)  # in no document, but some clients ask
async def latest_move(gateway: Gateway) -> MoveFull:
    """The newest move, running or not."""
    return MoveFull.of(await _one(gateway, MoveRequest(request=ListMoves(limit=1))))


@router.get("/{move_id}", responses=failures(404, 503))
async def get_move(move_id: MoveId, gateway: Gateway) -> MoveFull:
    return MoveFull.of(await _one(gateway, MoveRequest(request=GetMove(id=move_id))))


@router.get("/{move_id}/explain", responses=failures(404, 503))
async def explain_move(move_id: MoveId, request: Request, gateway: Gateway) -> MoveExplained:
    """Why a move failed, waits or is slow: the cause in words, what was in the way and where, what was measured
    against what was expected, the costmap around the robot, and the last 10 s of pose, command and path (an extension).
    """
    reply = await gateway.ask(topics.EXPLAIN, ExplainMove(id=move_id))
    return explained(reply.explanation, root_of(request, gateway))


@router.get("/{move_id}/explain/download", responses=failures(404, 503))
async def download_explanation(move_id: MoveId, request: Request, gateway: Gateway) -> JSONResponse:
    """The same as a file, to be attached to a report."""
    body = await explain_move(move_id, request, gateway)
    headers = {"content-disposition": f'attachment; filename="move_{move_id}.json"'}
    return JSONResponse(body.model_dump(mode="json"), headers=headers)


@router.get(
    "/{move_id}/explain/download.rrd",
    response_class=Response,
    responses={
        200: {"content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}},
        **failures(404, 503),
    },
)
async def download_recording(move_id: MoveId, gateway: Gateway) -> Response:
    """The same as a Rerun recording, which `rackhand view FILE` opens: costmap, things, paths, the last 10 s of pose,
    velocity and command, and the cause. The viewer makes it; 503 in a cell without one.
    """
    reply = await gateway.ask(topics.EXPLAIN, ExplainMove(id=move_id))
    recording = await _record(gateway, RecordMove(robot=gateway.chassis, explanation=reply.explanation))
    headers = {"content-disposition": f'attachment; filename="move_{move_id}.rrd"'}
    return Response(recording.data, media_type="application/octet-stream", headers=headers)


@router.patch("/current", responses=failures(400, 404, 413, 503))
async def change_current_move(body: MoveChangeBody, gateway: Gateway) -> MoveChanged:
    """Cancel, pause or resume the running move; 404 when there is none."""
    return await _change(gateway, None, body.state)


@router.patch("/{move_id}", responses=failures(400, 404, 413, 503))
async def change_move(move_id: MoveId, body: MoveChangeBody, gateway: Gateway) -> MoveChanged:
    """Cancel, pause or resume this move if it is running; 400 when it has ended."""
    return await _change(gateway, move_id, body.state)


async def _change(gateway: Context, move_id: int | None, state: MoveChange) -> MoveChanged:
    wanted = CancelMove(id=move_id) if state == "cancelled" else PauseMove(id=move_id, paused=state == "paused")
    await _one(gateway, MoveRequest(request=wanted))
    return MoveChanged(state=state)


async def _one(gateway: Context, request: MoveRequest) -> Move:
    reply = await gateway.ask(topics.MOVES, request)
    if not reply.moves:
        raise not_found("there is no such move")
    return reply.moves[0]


async def _record(gateway: Context, wanted: RecordMove) -> MoveRecording:
    """Raises ``HTTPException`` (503) without a viewer, and as ``BusClient.acall`` does."""
    try:
        return await gateway.shared.bus.acall(topics.MOVE_RECORDING, wanted, CELL, timeout=RECORDING_TIMEOUT)
    except Unavailable:
        raise unavailable(NO_VIEWER) from None
