"""``/world/faults``: what can go wrong in a simulated world, and what does at the moment. With hardware it is 503."""

from __future__ import annotations

from typing import Annotated, Literal

from fastapi import APIRouter
from pydantic import BaseModel, Field

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.faults import FAULTS, FaultName, Target
from rackhand.schemas.service import WORLD
from rackhand.schemas.world import ActiveFault, InjectFault, Inspect, WorldReply, WorldRequest
from rackhand.services.gateway.context import Context, Gateway
from rackhand.services.gateway.http.errors import failures

router = APIRouter(prefix="/world", tags=["world"])


class FaultRow(BaseModel):
    """A fault that the simulator can cause. ``targets``: what can have it, none where it is a new obstacle.

    ``parts``: how many parts of a target can have it. ``pose``: that it needs one in the map (``at``), or a shift in
    the target's own frame.
    """

    name: str
    kind: Target
    text: str
    parts: int
    pose: Literal["at", "shift"] | None
    targets: tuple[str, ...]
    active: tuple[ActiveFault, ...]


class FaultChange(BaseModel):
    """``part``: one of the parts of the target, such as a leg of a rack; all of them if none is named.

    ``amount``: how much, the fault's default if none is named. ``pose``: m and rad, for a fault that needs one.
    """

    fault: FaultName
    target: str
    part: Annotated[int, Field(ge=0)] | None = None
    amount: float | None = None
    pose: Pose2 | None = None
    active: bool = True


@router.get("/faults", responses=failures(503))
async def list_faults(gateway: Gateway) -> list[FaultRow]:
    """Every fault that the simulator can cause, and where it is in force."""
    return _rows(await _ask(gateway, Inspect()))


@router.post("/faults", responses=failures(400, 404, 413, 503))
async def change_fault(change: FaultChange, gateway: Gateway) -> list[FaultRow]:
    """Cause a fault, or clear it with `"active": false`. Answers as GET does."""
    return _rows(await _ask(gateway, InjectFault(**dict(change))))


async def _ask(gateway: Context, request: Inspect | InjectFault) -> WorldReply:
    return await gateway.shared.bus.acall(
        topics.WORLD_CONTROL, WorldRequest(request=request), WORLD, timeout=gateway.settings.call_timeout
    )


def _rows(reply: WorldReply) -> list[FaultRow]:
    return [
        FaultRow(
            name=kind.name,
            kind=kind.target,
            text=kind.text,
            parts=kind.parts,
            pose=kind.pose,
            targets=reply.faults.targets.get(kind.target, ()),
            active=tuple(fault for fault in reply.faults.active if fault.fault == kind.name),
        )
        for kind in FAULTS.values()
    ]
