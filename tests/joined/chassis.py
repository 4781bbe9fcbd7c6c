"""A planner core in a joined world, and a client of it: post moves, choose maps, follow what is published."""

from __future__ import annotations

import copy
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.schemas.chassis import ChassisCommand, ChassisRequest, Done, Odometry
from rackhand.schemas.explain import ExplainMove, Explanation
from rackhand.schemas.maps import CreateMap, GetMap, MapReply, MapRequest, SelectMap, UseMapData
from rackhand.schemas.moves import (
    TERMINAL,
    CancelMove,
    CreateMove,
    GetMove,
    Move,
    MoveCreate,
    MoveRequest,
    PlanningState,
)
from rackhand.schemas.parameters import ParameterChanges, ParametersRequest, SetParameters
from rackhand.schemas.topics import Topic
from rackhand.schemas.world import Clock
from rackhand.services.planner.chassis import PERIOD_NS, Chassis
from rackhand.services.planner.database import Database
from rackhand.services.planner.load import LoadStore
from rackhand.services.planner.map.directory import floor_directories, read_map_directory
from rackhand.services.planner.map.store import MapStore
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.moves.explanations import ExplanationStore
from rackhand.services.planner.moves.records import MoveStore
from rackhand.services.planner.parameters import ParameterStore
from rackhand.services.planner.settings import NavigationSettings
from rackhand.worlds.world_model import world_directory

if TYPE_CHECKING:
    from tests.joined.world import JoinedWorld

Json = dict[str, Any]


class JoinedChassis:
    """``published`` is all that the planner published: topic and message, oldest first; ``commands`` are its commands
    and ``odometry`` is what the driver measured.
    """

    service, period_ns = "planner", PERIOD_NS

    def __init__(self, world: JoinedWorld, name: str, folder: Path, navigation: NavigationSettings) -> None:
        self.world, self.name, self._navigation = world, name, navigation
        self.published: list[tuple[Topic[Any], Message]] = []
        self.commands: list[ChassisCommand] = []
        self.odometry: list[Odometry] = []
        self._database = Database(folder / f"{name}.sqlite", name)
        moves, maps = MoveStore(self._database), MapStore(self._database)
        directory = world_directory(world.session.simulation.world.name)
        maps.import_directory(read_map_directory(directory))
        for floor in floor_directories(directory):
            maps.import_directory(read_map_directory(floor), select=False)
        self._stored = maps.current
        self._planning = ThreadPoolExecutor(1, thread_name_prefix="plan")
        self.core = self._new_core(moves, maps)

    def _new_core(self, moves: MoveStore, maps: MapStore) -> Chassis:
        motion = Motion(self._navigation, self._planning)
        explanations = ExplanationStore(self._database)
        return Chassis(
            motion,
            moves,
            maps,
            ParameterStore(self._database),
            load=LoadStore(self._database),
            explanations=explanations,
        )

    def restart(self) -> None:
        """The planner is restarted: all that it knows is what is in its store. It uses the map of the world."""
        self.core = self._new_core(MoveStore(self._database), MapStore(self._database))
        self.core.on_clock(self.world.session.clock)
        self.begin()

    def close(self) -> None:
        self._planning.shutdown()
        self._database.close()

    # -- as the service does -----------------------------------------------------------------------------------------

    def begin(self) -> None:
        """The driver begins a run."""
        self.core.reset("driver restarted")
        self.core.set_driver_fault("")
        self.core.on_message(self.world.simulation.robots[self.name].chassis_model())

    def on_clock(self, clock: Clock) -> None:
        self.core.on_clock(clock)

    def on_message(self, topic: Topic[Any], message: Any) -> None:
        if topic is topics.IMU:
            return
        self.core.on_message(message)
        if topic is topics.ODOMETRY:
            self.odometry.append(message)
        if topic is topics.ODOMETRY and message.stamp % PERIOD_NS == 0:
            self.commands.append(self.core.tick(lockstep=True))
            self.world.session.command(self.name, self.commands[-1])
        self.published += [(p.topic, p.message) for p in self.core.take_publications()]

    # -- as a client does --------------------------------------------------------------------------------------------

    def post(self, body: Json | None = None, /, **fields: Any) -> int:
        """Create a move; its id. Raises ``RequestRefused``."""
        move = MoveCreate(**{"creator": "test", **(body or {}), **fields})
        return self.core.moves(MoveRequest(request=CreateMove(move=move))).moves[0].id

    def move(self, move_id: int) -> Move:
        return self.core.moves(MoveRequest(request=GetMove(id=move_id))).moves[0]

    def cancel(self, move_id: int | None = None) -> Move:
        return self.core.moves(MoveRequest(request=CancelMove(id=move_id))).moves[0]

    def change(self, request: Any) -> Move:
        """One of the requests about moves, as to pause the running one."""
        return self.core.moves(MoveRequest(request=request)).moves[0]

    def set_parameters(self, **changes: Any) -> None:
        """Change what the chassis drives with, by the names of ``ParameterChanges``."""
        request = SetParameters(changes=ParameterChanges(**changes))
        self.core.parameters.answer(ParametersRequest(request=request))

    def finish(self, move_id: int, within: float = 240.0) -> Move:
        """Let time pass until that move has ended."""
        what = f"move {move_id} ends: {self.move(move_id)}"
        return self.world.wait_for(lambda: self._ended(move_id), what, within)

    def drive(self, body: Json | None = None, /, within: float = 240.0, **fields: Any) -> Move:
        return self.finish(self.post(body, **fields), within)

    def wait_until_moving(self, by: float = 0.3) -> None:
        """Let time pass until the chassis has left its place by so much (m)."""
        start = self.world.true_pose(self.name)

        def left() -> bool | None:
            pose = self.world.true_pose(self.name)
            return True if (pose.x - start.x) ** 2 + (pose.y - start.y) ** 2 > by**2 else None

        self.world.wait_for(left, f"{self.name} moves", 60.0)

    def ask(self, request: Any) -> Done:
        """One of the chassis' requests (jack, control mode, emergency stop …)."""
        return self.core.chassis(ChassisRequest(request=request))

    def newest(self, topic: Topic[Any]) -> Any:
        return next(message for told, message in reversed(self.published) if told is topic)

    def stays_still(self) -> bool:
        """Let a second pass; whether the chassis truly stays where it is."""
        before = self.world.true_pose(self.name)
        self.world.advance(1.0)
        after = self.world.true_pose(self.name)
        return max(abs(before.x - after.x), abs(before.y - after.y), abs(before.yaw - after.yaw)) < 5e-3

    @property
    def planning_state(self) -> PlanningState:
        found = self.newest(topics.PLANNING_STATE)
        assert isinstance(found, PlanningState)
        return found

    # -- maps --------------------------------------------------------------------------------------------------------

    def ask_maps(self, request: Any) -> MapReply:
        return self.core.maps(MapRequest(request=request))

    def overlay(self, *features: Json) -> None:
        """Use the geometry of the world's map with these overlay features only."""
        assert self._stored is not None
        data = self.ask_maps(GetMap(id=self._stored.id)).data
        assert data is not None
        self.use_map(data.png, *data.origin, data.resolution, *features)

    def use_map(self, png: bytes, origin_x: float, origin_y: float, resolution: float, *features: Json) -> None:
        """Use a map given whole."""
        overlays = {"type": "FeatureCollection", "features": copy.deepcopy(list(features))}
        whole = CreateMap(
            map_name="of a test", png=png, origin=(origin_x, origin_y), resolution=resolution, overlays=overlays
        )
        self.ask_maps(UseMapData(map=whole))

    def explain(self, move_id: int | None = None) -> Explanation:
        """Why a move failed, waits or is slow."""
        return self.core.explain(ExplainMove(id=move_id)).explanation

    def use_stored_map(self) -> None:
        """Back to the map of the world."""
        assert self._stored is not None
        self.ask_maps(SelectMap(id=self._stored.id))

    def use_no_map(self) -> None:
        self.ask_maps(SelectMap())

    def _ended(self, move_id: int) -> Move | None:
        move = self.move(move_id)
        return move if move.state in TERMINAL else None
