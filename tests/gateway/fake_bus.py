"""A robot that keeps its moves and maps in memory, behind the interface of the bus."""

from __future__ import annotations

from typing import Any

from rackhand.bus import BusError, Refused, Unavailable
from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.chassis import ChassisRequest, Done, SetControlMode
from rackhand.schemas.explain import ExplainMove, ExplainReply, Explanation, MoveRecording, RecordMove
from rackhand.schemas.maps import (
    ChangeOverlays,
    CreateMap,
    DeleteMap,
    GetMap,
    ListMaps,
    MapData,
    MapReply,
    MapRequest,
    MapSummary,
    PatchMap,
    ReplaceMap,
    SelectMap,
    UseMapData,
)
from rackhand.schemas.moves import (
    CancelMove,
    ClearMoves,
    CreateMove,
    GetMove,
    ListMoves,
    Move,
    MoveReply,
    MoveRequest,
    PauseMove,
)
from rackhand.schemas.parameters import ParameterChanges, ParametersReply, ParametersRequest, SetParameters
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.schemas.service import CELL, WORLD
from rackhand.schemas.world import ActiveFault, Clock, FaultState, InjectFault, WorldReply, WorldRequest
from rackhand.services.planner.parameters import Basis, changed, check, defaults, in_force, ranges
from rackhand.services.planner.settings import NavigationSettings
from tests.chassis_models import chassis_model
from tests.gateway.explanations import explanation

NOW = 1_746_684_372
WITHOUT_TARGET = ("follow_target", "charge")
TARGET_MISSING = "(target_x target_y) or target_ori must be provided"


class FakeBus:
    """``failure``, when set, is raised for every call; ``requests`` holds what was asked."""

    def __init__(self, robot: str = "amr1") -> None:
        self.robot = robot
        self.failure: BusError | None = None
        self.requests: list[Any] = []
        self.moves: dict[int, Move] = {}
        self.pauses: list[PauseMove] = []
        self.explained = explanation()
        self.recording: bytes | None = None  # what the viewer answers; None without one
        self.recorded: list[RecordMove] = []
        self.maps: dict[int, MapData] = {}
        self.current_map: MapData | None = None
        self.control_mode = "auto"
        self.basis = Basis(limits=NavigationSettings().for_chassis(chassis_model()).own)
        self.parameters = ParameterChanges()
        self.faults: tuple[ActiveFault, ...] = ()

    async def acall(self, query: topics.Query[Any, Any], request: Any, robot: str, timeout: float) -> Any:
        assert robot == {topics.WORLD_CONTROL: WORLD, topics.MOVE_RECORDING: CELL}.get(query, self.robot)
        assert timeout > 0
        if self.failure is not None:
            raise self.failure
        if isinstance(request, ExplainMove):
            return ExplainReply(explanation=self._explain(request))
        if isinstance(request, RecordMove):
            return self._record(request)
        self.requests.append(request.request)
        match request:
            case MoveRequest():
                assert query is topics.MOVES
                return MoveReply(moves=tuple(self._moves(request.request)))
            case MapRequest():
                assert query is topics.MAPS
                return self._maps(request.request)
            case ChassisRequest():
                assert query is topics.CHASSIS_REQUEST
                return self._chassis(request.request)
            case ParametersRequest():
                assert query is topics.CHASSIS_PARAMETERS
                return self._parameters(request.request)
            case WorldRequest():
                return self._world(request.request)
        raise AssertionError(request)

    def _world(self, request: Any) -> WorldReply:
        if isinstance(request, InjectFault):
            if request.target != self.robot:
                raise Refused(RefusalCode.NOT_FOUND, f"chassis {request.target!r} is not known; known: {self.robot}")
            fault = ActiveFault(fault=request.fault, target=request.target, part=request.part)
            self.faults = (fault,) if request.active else ()
        return WorldReply(
            clock=Clock(
                run="run", stamp=0, step_ns=1, speed=1.0, paused=False, lockstep=False, unix_ns=NOW * NANOSECONDS
            ),
            seed=0,
            digest="",
            contact_count=0,
            contacts=(),
            participants=(),
            command_stamps={},
            faults=FaultState(active=self.faults, targets={"chassis": (self.robot,)}),
        )

    def _explain(self, request: ExplainMove) -> Explanation:
        """``explained`` of a move that is there."""
        if request.id not in self.moves:
            raise Refused(RefusalCode.NOT_FOUND, f"there is no move {request.id}")
        return self.explained.model_copy(update={"move": self.moves[request.id]})

    def _record(self, request: RecordMove) -> MoveRecording:
        if self.recording is None:
            raise Unavailable(f"no service answers {topics.MOVE_RECORDING.name} of {CELL}")
        self.recorded.append(request)
        return MoveRecording(data=self.recording)

    @property
    def running(self) -> Move | None:
        return next((move for move in self.moves.values() if move.state == "moving"), None)

    def end(self, move_id: int, **changes: Any) -> None:
        self.moves[move_id] = self.moves[move_id].model_copy(update=changes)

    def _moves(self, request: Any) -> list[Move]:
        running = self.running
        match request:
            case CreateMove(move=wanted):
                if wanted.target_x is None and wanted.target_ori is None and wanted.type not in WITHOUT_TARGET:
                    raise Refused(RefusalCode.INVALID, TARGET_MISSING)
                if running is not None:
                    self.end(running.id, state="cancelled")
                move = Move(
                    **wanted.model_dump(),
                    id=len(self.moves) + 1,
                    state="moving",
                    create_time=NOW,
                    last_modified_time=NOW,
                )
                self.moves[move.id] = move
                return [move]
            case ClearMoves():
                self.moves = {move.id: move for move in self.moves.values() if move.state == "moving"}
                return []
            case ListMoves(offset=offset, limit=limit):
                newest_first = list(reversed(self.moves.values()))
                return newest_first[offset : None if limit is None else offset + limit]
            case GetMove(id=move_id) | CancelMove(id=move_id) | PauseMove(id=move_id):
                move_or_none = running if move_id is None else self.moves.get(move_id)
                if move_or_none is None:
                    raise Refused(
                        RefusalCode.NOT_FOUND, "no move is active" if move_id is None else f"there is no move {move_id}"
                    )
                if not isinstance(request, GetMove) and move_or_none.state != "moving":
                    raise Refused(RefusalCode.PRECONDITION, f"move {move_or_none.id} is {move_or_none.state}")
                if isinstance(request, PauseMove):
                    self.pauses.append(request)
                if isinstance(request, CancelMove):
                    self.end(move_or_none.id, state="cancelled")
                return [self.moves[move_or_none.id]]
        raise AssertionError(request)

    def _chassis(self, request: Any) -> Done:
        if isinstance(request, SetControlMode):
            self.control_mode = request.control_mode
        if request.op == "remote_twist" and self.control_mode != "remote":
            raise Refused(
                RefusalCode.PRECONDITION, f"the control mode is {self.control_mode}; remote driving needs mode remote"
            )
        return Done()

    def _parameters(self, request: Any) -> ParametersReply:
        """By the planner's own rules."""
        if isinstance(request, SetParameters):
            try:
                check(request.changes, self.basis, request.names)
            except RequestRefused as refused:
                raise Refused(refused.code, refused.text) from None
            self.parameters = changed(self.parameters, request)
        return ParametersReply(
            values=in_force(self.parameters, self.basis),
            defaults=defaults(self.basis),
            user=self.parameters,
            ranges=ranges(self.basis),
        )

    def _maps(self, request: Any) -> MapReply:
        match request:
            case ListMaps():
                return MapReply(maps=tuple(summary(data) for data in self.maps.values()))
            case CreateMap():
                return MapReply(maps=(summary(self._store(request)),))
            case GetMap(id=None):
                if self.current_map is None:
                    raise Refused(RefusalCode.NOT_FOUND, "no map is in use")
                return MapReply(data=self.current_map)
            case GetMap(id=map_id):
                return MapReply(data=self._find(map_id))
            case ReplaceMap(id=map_id, map=whole):
                uid = whole.uid or self._find(map_id).uid
                self.maps[map_id] = to_data(whole.model_copy(update={"uid": uid}), map_id)
                return MapReply(maps=(summary(self.maps[map_id]),))
            case PatchMap(id=map_id):
                changes = request.model_dump(exclude={"op", "id"}, exclude_none=True)
                self.maps[map_id] = self._find(map_id).model_copy(update=changes)
                return MapReply(maps=(summary(self.maps[map_id]),))
            case DeleteMap(id=map_id):
                self._find(map_id)
                del self.maps[map_id]
                return MapReply()
            case SelectMap(id=map_id, uid=uid):
                found = [data for data in self.maps.values() if data.id == map_id or data.uid == uid]
                if not found:
                    raise Refused(RefusalCode.NOT_FOUND, f"there is no map {map_id if uid is None else uid}")
                self.current_map = found[0]
                return MapReply(maps=(summary(found[0]),))
            case ChangeOverlays(overlays=overlays):
                if self.current_map is None:
                    raise Refused(RefusalCode.NOT_FOUND, "no map is in use")
                version = self.current_map.overlays_version + 1
                changes = {"overlays": overlays, "overlays_version": version}
                self.current_map = self.current_map.model_copy(update=changes)
                return MapReply(data=self.current_map)
            case UseMapData(map=created):
                self.current_map = to_data(created, -1)
                return MapReply(maps=(summary(self.current_map),))
        raise AssertionError(request)

    def _find(self, map_id: int | None) -> MapData:
        if map_id not in self.maps:
            raise Refused(RefusalCode.NOT_FOUND, f"there is no map {map_id}")
        return self.maps[map_id]

    def _store(self, created: CreateMap) -> MapData:
        data = to_data(created, max(self.maps, default=0) + 1)
        self.maps[data.id] = data
        return data


def to_data(created: CreateMap, map_id: int) -> MapData:
    fields = created.model_dump(exclude={"op"}) | {"uid": created.uid or f"uid-{map_id}"}
    return MapData(**fields, id=map_id, create_time=NOW, last_modified_time=NOW)


def summary(data: MapData) -> MapSummary:
    return MapSummary(**data.model_dump(include=set(MapSummary.model_fields)))
