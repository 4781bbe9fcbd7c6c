"""A chassis core with a scripted navigator and a store in a temporary file."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Message, Pose2, Twist2
from rackhand.schemas.chassis import (
    ChassisCommand,
    ChassisModel,
    ChassisRequest,
    Contacts,
    Costmap,
    Done,
    Jack,
    LocalisedPose,
    Odometry,
)
from rackhand.schemas.maps import CreateMap, MapData, MapReply, MapRequest
from rackhand.schemas.moves import CancelMove, CreateMove, GetMove, Move, MoveCreate, MoveRequest, PlanningState
from rackhand.schemas.topics import Topic
from rackhand.schemas.world import Clock
from rackhand.services.planner.behaviors.interface import Progress
from rackhand.services.planner.chassis import Chassis, ChassisSettings
from rackhand.services.planner.database import Database
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.map.store import MapStore
from rackhand.services.planner.moves.records import MoveStore
from rackhand.services.planner.perception.chassis_state import Observation
from rackhand.services.planner.planning.goals import Goal
from tests.chassis_models import chassis_model

STEP = 40_000_000
UNIX_NS = 1_700_000_000 * NANOSECONDS
FORWARD = Twist2(linear=0.5, angular=0.0)


# ruff: noqa: ARG002


class ScriptedNavigator:
    """Drives forward for ever, or does what the script says: a ``Progress`` to return, an exception to raise."""

    def __init__(self) -> None:
        self.map: MapData | None = None
        self.goal: Goal | None = None
        self.goals: list[Goal] = []
        self.ticks: list[Progress | Exception] = []
        self.starts: list[Exception | None] = []
        self.maps: list[Exception | None] = []
        self.observed = 0
        self.observing: Exception | None = None
        self.model: ChassisModel | None = None

    def set_map(self, data: MapData | None) -> None:
        if self.maps and (error := self.maps.pop(0)) is not None:
            self.map = None
            raise error
        self.map = data

    def set_model(self, model: ChassisModel) -> None:
        self.model = model

    def reset(self) -> None:
        self.goal = None

    def start(self, goal: Goal, seen: Observation) -> None:
        self.goals.append(goal)
        if self.starts and (error := self.starts.pop(0)) is not None:
            raise error
        self.goal = goal

    def tick(self, seen: Observation) -> Progress:
        assert self.goal is not None, "ticked without a goal"
        step = self.ticks.pop(0) if self.ticks else driving()
        if isinstance(step, Exception):
            raise step
        return step

    def observe(self, seen: Observation) -> None:
        if self.observing is not None:
            raise self.observing
        self.observed += 1

    def costmap(self, stamp: int) -> Costmap | None:
        return (
            None
            if self.map is None
            else Costmap(stamp=stamp, origin=(0.0, 0.0), resolution=0.05, columns=2, cost=np.zeros(4, np.uint8))
        )

    def brake(self, seen: Observation) -> Twist2:
        slower = max(0.0, abs(seen.twist.linear) - 0.08)
        return Twist2(linear=slower if seen.twist.linear > 0 else -slower, angular=0.0)

    def stop(self) -> None:
        self.goal = None


def driving(distance: float = 5.0, **more: Any) -> Progress:
    path = np.array([[0.0, 0.0, 0.0], [distance, 0.0, 0.0]])
    return replace(Progress(twist=FORWARD, remaining_distance=distance, path=path), **more)


ARRIVED = Progress(twist=STANDSTILL, arrived=True)


def png(mode: str = "L", size: tuple[int, int] = (8, 6)) -> bytes:
    buffer = io.BytesIO()
    Image.new(mode, size, "white").save(buffer, "PNG")
    return buffer.getvalue()


def a_map(name: str = "hall", **more: Any) -> CreateMap:
    return CreateMap(map_name=name, png=png(), origin=(-1.0, -2.0), resolution=0.05, **more)


@dataclass
class Cell:
    """A chassis whose driver does what it is told at once, ticked by hand."""

    path: Path
    settings: ChassisSettings = field(default_factory=ChassisSettings)
    with_map: bool = True
    stamp: int = 0
    run: str = "first"
    twist: Twist2 = STANDSTILL
    jack: Jack | None = None
    contacts: dict[str, bool] = field(default_factory=dict)
    pose_alive: bool = True
    quality: int = 8
    told: list[tuple[Topic[Any], Message]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.navigator = ScriptedNavigator()
        self.database = Database(self.path, "amr1")
        self.moves = MoveStore(self.database)
        self.maps = MapStore(self.database)
        if self.with_map and self.maps.current is None:
            self.maps.use(self.maps.create(a_map(), 0))
        self.chassis = Chassis(self.navigator, self.moves, self.maps, self.settings)
        self.chassis.on_message(chassis_model())
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
            command = self.chassis.tick()
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
