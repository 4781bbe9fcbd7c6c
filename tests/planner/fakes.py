"""A chassis core with scripted behaviours and a store in a temporary file."""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Message, Pose2, Twist2
from rackhand.schemas.chassis import (
    ChassisCommand,
    ChassisRequest,
    Contacts,
    Done,
    Jack,
    LocalisedPose,
    Odometry,
    Scan,
)
from rackhand.schemas.maps import CreateMap, MapData, MapReply, MapRequest
from rackhand.schemas.moves import (
    CancelMove,
    CreateMove,
    GetMove,
    Move,
    MoveCreate,
    MoveRequest,
    PauseMove,
    PlanningState,
)
from rackhand.schemas.topics import Topic
from rackhand.schemas.world import Clock
from rackhand.services.planner.behaviors.base import Context, Drive, Status
from rackhand.services.planner.behaviors.base import Done as Succeeded
from rackhand.services.planner.behaviors.registry import BEHAVIORS
from rackhand.services.planner.chassis import Chassis
from rackhand.services.planner.chassis_settings import ChassisSettings
from rackhand.services.planner.database import Database
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.load import LoadStore
from rackhand.services.planner.map.store import MapStore
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.moves.records import MoveStore
from rackhand.services.planner.parameters import ParameterStore
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.settings import NavigationSettings
from tests.chassis_models import LIMITS, chassis_model

STEP = 40_000_000
UNIX_NS = 1_700_000_000 * NANOSECONDS
FORWARD = Twist2(linear=0.5, angular=0.0)


@dataclass
class Script:
    """What a behaviour does in tests: drives forward for ever, or per tick what ``ticks`` say: drive, done, or raise.

    A behaviour factory too: ``requests`` are the moves it was made for.
    """

    ticks: list[tuple[Drive | Succeeded, Status] | Exception] = field(default_factory=list)
    requests: list[MoveCreate] = field(default_factory=list)
    steps: int = 0
    resumed: int = 0
    _status: Status = field(default_factory=Status)

    def __call__(self, request: MoveCreate) -> Script:
        self.requests.append(request)
        return self

    def step(self, _ctx: Context) -> Drive | Succeeded:
        self.steps += 1
        step = self.ticks.pop(0) if self.ticks else driving()
        if isinstance(step, Exception):
            raise step
        outcome, self._status = step
        return outcome

    def resume(self, _ctx: Context) -> None:
        self.resumed += 1

    def status(self) -> Status:
        return self._status


class SpyMotion(Motion):
    """Remembers the map in use; ``maps`` are errors to raise in place of taking one."""

    map: MapData | None = None
    maps: tuple[Exception, ...] = ()

    def set_map(self, data: MapData | None, loaded: LocalCostmap | None = None) -> None:
        if self.maps:
            error, *rest = self.maps
            self.maps = tuple(rest)
            raise error
        super().set_map(data, loaded)
        self.map = data


def driving(distance: float = 5.0, **more: Any) -> tuple[Drive, Status]:
    path = np.array([[0.0, 0.0, 0.0], [distance, 0.0, 0.0]])
    return Drive(FORWARD), Status(**{"path": path, "remaining_distance": distance} | more)


ARRIVED = (Succeeded(), Status())


def free_scan(stamp: int, reach: float = 9.0) -> Scan:
    """Something all around at ``reach`` metres, nothing nearer."""
    ranges = np.full(90, reach, dtype="<f4")
    step = 2 * math.pi / len(ranges)
    return Scan(
        stamp=stamp,
        sensor=Pose2(x=0.0, y=0.0, yaw=0.0),
        angle_min=-math.pi,
        angle_step=step,
        range_max=25.0,
        ranges=ranges,
    )


def png(mode: str = "L", size: tuple[int, int] = (8, 6)) -> bytes:
    buffer = io.BytesIO()
    Image.new(mode, size, "white").save(buffer, "PNG")
    return buffer.getvalue()


def a_map(name: str = "hall", **more: Any) -> CreateMap:
    return CreateMap(map_name=name, png=png(), origin=(-1.0, -2.0), resolution=0.05, **more)


@dataclass
class Cell:
    """A chassis whose driver follows each command at once, ticked by hand; ``standard`` moves are ``script``."""

    path: Path
    settings: ChassisSettings = field(default_factory=ChassisSettings)
    behaviors: dict[str, Any] = field(default_factory=dict)
    with_map: bool = True
    stamp: int = 0
    run: str = "first"
    twist: Twist2 = STANDSTILL
    jack: Jack | None = None
    contacts: dict[str, bool] = field(default_factory=dict)
    pose_alive: bool = True
    scan_alive: bool = True
    reach: float = 9.0
    quality: int = 8
    told: list[tuple[Topic[Any], Message]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.script = Script()
        self.executor = ThreadPoolExecutor(1)
        registry = BEHAVIORS | {"none": self.script, "standard": self.script} | self.behaviors
        self.motion = SpyMotion(NavigationSettings(), self.executor, registry)
        self.database = Database(self.path, "amr1")
        self.moves = MoveStore(self.database)
        self.maps = MapStore(self.database)
        if self.with_map and self.maps.current is None:
            self.maps.use(self.maps.create(a_map(), 0))
        self.parameters = ParameterStore(self.database)
        self.chassis = Chassis(
            self.motion, self.moves, self.maps, self.parameters, self.settings, LoadStore(self.database)
        )
        self.chassis.on_message(chassis_model(limits=LIMITS.model_copy(update={"acceleration": 1000.0})))
        self.chassis.set_driver_fault("")
        self.sense()

    def sense(self) -> None:
        """All that the driver tells of this instant."""
        pose = Pose2(x=0.0, y=0.0, yaw=0.0)
        if self.pose_alive:
            self.chassis.on_message(
                LocalisedPose(stamp=self.stamp, pose=pose, covariance=np.eye(3) * 1e-4, quality=self.quality)
            )
        if self.jack is not None:
            self.chassis.on_message(self.jack.model_copy(update={"stamp": self.stamp}))
        if self.scan_alive:
            self.chassis.on_message(free_scan(self.stamp, self.reach))
        self.chassis.on_message(Contacts(stamp=self.stamp, **self.contacts))
        self.chassis.on_message(Odometry(stamp=self.stamp, pose=pose, twist=self.twist, wheel_velocities=(0.0, 0.0)))
        self.chassis.on_clock(self.clock())

    def clock(self) -> Clock:
        return Clock(
            stamp=self.stamp,
            run=self.run,
            step_ns=2_000_000,
            speed=1.0,
            paused=False,
            lockstep=True,
            unix_ns=UNIX_NS,
        )

    def tick(self, count: int = 1) -> ChassisCommand:
        """The last of ``count`` commands."""
        for _ in range(count):
            self.stamp += STEP
            self.sense()
            command = self.chassis.tick(lockstep=True)
            self.twist = command.twist
            self.told += [(p.topic, p.message) for p in self.chassis.take_publications()]
        return command

    def create(self, **fields: Any) -> Move:
        move = MoveCreate(**({"type": "standard", "target_x": 3.0, "target_y": 0.0} | fields))
        return self.chassis.moves(MoveRequest(request=CreateMove(move=move))).moves[0]

    def get(self, move_id: int) -> Move:
        return self.chassis.moves(MoveRequest(request=GetMove(id=move_id))).moves[0]

    def cancel(self, move_id: int | None = None) -> Move:
        return self.chassis.moves(MoveRequest(request=CancelMove(id=move_id))).moves[0]

    def pause(self, paused: bool = True, move_id: int | None = None) -> Move:
        return self.chassis.moves(MoveRequest(request=PauseMove(id=move_id, paused=paused))).moves[0]

    def ask(self, request: Any) -> Done:
        return self.chassis.chassis(ChassisRequest(request=request))

    def ask_maps(self, request: Any) -> MapReply:
        return self.chassis.maps(MapRequest(request=request))

    def heard(self, topic: Topic[Any]) -> list[Any]:
        """Everything published on a topic so far."""
        self.told += [(p.topic, p.message) for p in self.chassis.take_publications()]
        return [message for told, message in self.told if told is topic]

    def events(self) -> list[str]:
        return [event.event for event in self.heard(topics.MOVE_EVENT)]

    def planning(self) -> PlanningState:
        state = self.heard(topics.PLANNING_STATE)[-1]
        assert isinstance(state, PlanningState)
        return state

    def run_until(self, done: Callable[[], bool], most: int = 2000) -> None:
        for _ in range(most):
            if done():
                return
            self.tick()
        raise AssertionError("did not happen")
