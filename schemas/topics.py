"""The contract: one row a topic. Reference docs, access lists and the viewer's routing are derived from this table.

Adding a topic is adding a row.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any, Generic, TypeVar

from rackhand.schemas import chassis, maps, motion, moves, service, world
from rackhand.schemas.base import Message
from rackhand.schemas.service import WORLD

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)


class Qos(Enum):
    """How a topic is carried.

    ``STREAM``: newest wins, a slow reader loses old samples. ``COMMAND``: never dropped on the way, ahead of data.
    ``EVENT``: every one arrives, in order. ``LATCHED``: like events, and who comes later gets the last one at once.
    """

    STREAM = "stream"
    COMMAND = "command"
    EVENT = "event"
    LATCHED = "latched"


@dataclass(frozen=True)
class Topic(Generic[M]):
    """A published topic. ``key`` has ``{robot}`` where its name goes; rates in Hz of simulation time, 0 = on change."""

    name: str
    key: str
    model: type[M]
    publisher: str
    rate: float
    qos: Qos
    text: str

    def key_for(self, robot: str) -> str:
        return self.key.format(robot=robot)


@dataclass(frozen=True)
class Query(Generic[Q, R]):
    """A query: a request model in, a reply model out, a ``Refusal`` as the error."""

    name: str
    key: str
    request: type[Q]
    reply: type[R]
    server: str
    commander: str
    text: str

    def key_for(self, robot: str) -> str:
        return self.key.format(robot=robot)


def _chassis(name: str, model: type[M], rate: float, qos: Qos, text: str, publisher: str = "driver") -> Topic[M]:
    return Topic(f"chassis/{name}", f"rackhand/{{robot}}/chassis/{name}", model, publisher, rate, qos, text)


ODOMETRY = _chassis("odometry", chassis.Odometry, 50, Qos.STREAM, "wheel odometry; last of what belongs to one instant")
SCAN = _chassis("scan", chassis.Scan, 12.5, Qos.STREAM, "2-D lidar")
IMU = _chassis("imu", chassis.Imu, 50, Qos.STREAM, "angular velocity and specific force")
JACK = _chassis("jack", chassis.Jack, 5, Qos.STREAM, "jack state and progress")
BATTERY = _chassis("battery", chassis.Battery, 1, Qos.STREAM, "charge, voltage, current")
CONTACTS = _chassis("contacts", chassis.Contacts, 10, Qos.STREAM, "bumpers, charging contacts, cable, stop button")
CHASSIS_MODEL = _chassis(
    "model", chassis.ChassisModel, 0, Qos.LATCHED, "footprint, limits, lidar, jack and charge contact"
)
POSE = _chassis("pose", chassis.LocalisedPose, 25, Qos.STREAM, "localised pose in the map", publisher="localisation")
CHASSIS_STATUS = _chassis("status", chassis.ChassisStatus, 0, Qos.LATCHED, "mode, stops, alerts", publisher="planner")
COMMAND = _chassis("command", chassis.ChassisCommand, 25, Qos.COMMAND, "body velocity and jack", publisher="planner")
COSTMAP = _chassis("costmap", chassis.Costmap, 1, Qos.STREAM, "what the planner steers by nearby", publisher="planner")

PLANNING_STATE = Topic(
    "moves/planning_state",
    "rackhand/{robot}/moves/planning_state",
    moves.PlanningState,
    "planner",
    5,
    Qos.LATCHED,
    "state of the current or last move",
)
PATH = Topic(
    "moves/path", "rackhand/{robot}/moves/path", moves.PlannedPath, "planner", 5, Qos.LATCHED, "the path ahead"
)
MOVE_EVENT = Topic(
    "moves/event", "rackhand/{robot}/moves/event", moves.MoveEvent, "planner", 0, Qos.EVENT, "what happened to a move"
)
MAP = Topic("map", "rackhand/{robot}/map", maps.CurrentMap, "planner", 0, Qos.LATCHED, "map in use, with overlays")

ARM_STATE = Topic(
    "arm/state",
    "rackhand/{robot}/arm/state",
    motion.ArmState,
    "driver",
    500,
    Qos.STREAM,
    "joint positions, velocities, efforts, flange wrench",
)
ARM_MODEL = Topic(
    "arm/model",
    "rackhand/{robot}/arm/model",
    motion.ArmModel,
    "driver",
    0,
    Qos.LATCHED,
    "which arm it is, and where its base stands",
)
ARM_COMMAND = Topic(
    "arm/command",
    "rackhand/{robot}/arm/command",
    motion.ArmCommand,
    "controller",
    250,
    Qos.COMMAND,
    "joint positions, velocities or torques, with the fencing token",
)
MOTION_STATUS = Topic(
    "motion/status",
    "rackhand/{robot}/motion/status",
    motion.MotionStatus,
    "controller",
    25,
    Qos.STREAM,
    "the arm's CRF status",
)
MOTION_EVENT = Topic(
    "motion/event",
    "rackhand/{robot}/motion/event",
    motion.MotionEvent,
    "controller",
    0,
    Qos.EVENT,
    "control granted and lost, stops",
)
MOTION_PATH = Topic(
    "motion/path",
    "rackhand/{robot}/motion/path",
    motion.MotionPath,
    "controller",
    0,
    Qos.LATCHED,
    "the tool's way through all that is queued",
)
MOTION_DIAGNOSTICS = Topic(
    "motion/diagnostics",
    "rackhand/{robot}/motion/diagnostics",
    motion.MotionDiagnostics,
    "controller",
    25,
    Qos.STREAM,
    "tracking errors, time of ticks and of the solver, late ticks",
)
MOTION_STREAM = Topic(
    "motion/stream",
    "rackhand/{robot}/motion/stream",
    motion.MotionStream,
    "controller",
    0,
    Qos.EVENT,
    "status streams, each for one session",
)
MOTION_SESSION = Topic(
    "motion/session",
    "rackhand/{robot}/motion/session",
    motion.SessionGone,
    "gateway",
    0,
    Qos.EVENT,
    "a client's connection is gone",
)

BUS_STATS = Topic(
    "bus/stats",
    "rackhand/{robot}/bus/stats",
    service.BusStats,
    "every service",
    0,
    Qos.STREAM,
    "what its inboxes read, lost and could not parse, once a second of the machine's time",
)

CLOCK = Topic("clock", "rackhand/world/clock", world.Clock, "sim", 50, Qos.STREAM, "simulation time, speed, paused")
OBJECTS = Topic("objects", "rackhand/world/objects", world.Objects, "sim", 25, Qos.STREAM, "true poses, for judges")
SCENE = Topic("scene", "rackhand/world/scene", world.Scene, "sim", 0, Qos.LATCHED, "geometry as data, for viewers")

MOVES = Query(
    "moves/command",
    "rackhand/{robot}/moves/command",
    moves.MoveRequest,
    moves.MoveReply,
    "planner",
    "gateway, anyone allowed",
    "create, get, list, cancel moves",
)
CHASSIS_REQUEST = Query(
    "chassis/request",
    "rackhand/{robot}/chassis/request",
    chassis.ChassisRequest,
    chassis.Done,
    "planner",
    "gateway, anyone allowed",
    "jack, control mode, emergency stop, remote twist, pose",
)
MAPS = Query(
    "maps",
    "rackhand/{robot}/maps",
    maps.MapRequest,
    maps.MapReply,
    "planner",
    "gateway, anyone allowed",
    "the robot's map store and the choice of the current map",
)
MOTION = Query(
    "motion/command",
    "rackhand/{robot}/motion/command",
    motion.CrfCall,
    motion.CrfAnswer,
    "controller",
    "anyone allowed",
    "a CRF request in, its reply out",
)
MOTION_STOP = Query(
    "motion/stop",
    "rackhand/{robot}/motion/stop",
    motion.CrfCall,
    motion.CrfAnswer,
    "controller",
    "anyone allowed",
    "softStop and hardStop, never behind a queue",
)
WORLD_CONTROL = Query(
    "world/control",
    "rackhand/world/control",
    world.WorldRequest,
    world.WorldReply,
    "sim",
    "tests, users, participants",
    "join, pause, advance, speed, reset, place, faults, inspect",
)

TOPICS: tuple[Topic[Any], ...] = (
    ODOMETRY, SCAN, IMU, JACK, BATTERY, CONTACTS, CHASSIS_MODEL, POSE, CHASSIS_STATUS, COMMAND, COSTMAP,
    PLANNING_STATE, PATH, MOVE_EVENT, MAP, ARM_STATE, ARM_MODEL, ARM_COMMAND, MOTION_STATUS, MOTION_EVENT, MOTION_PATH,
    MOTION_DIAGNOSTICS, MOTION_STREAM, MOTION_SESSION, BUS_STATS, CLOCK, OBJECTS, SCENE,
)  # fmt: skip
QUERIES: tuple[Query[Any, Any], ...] = (MOVES, CHASSIS_REQUEST, MAPS, MOTION, MOTION_STOP, WORLD_CONTROL)

__all__ = ["QUERIES", "TOPICS", "WORLD", "Qos", "Query", "Topic"]
