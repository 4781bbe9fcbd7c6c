"""The contract: one row a topic.

Subscriptions, publications, rates, reference docs, access lists, the AsyncAPI document and the gateway's WebSocket
topics are derived from this table.

Adding a topic is adding a row; a query likewise.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any, Generic, Literal, TypeVar

from rackhand.schemas import chassis, explain, lift, maps, motion, moves, parameters, racks, service, world
from rackhand.schemas import websocket as ws
from rackhand.schemas import websocket_lifts as ws_lifts
from rackhand.schemas import websocket_racks as ws_racks
from rackhand.schemas import websocket_sensors as ws_sensors
from rackhand.schemas.base import NANOSECONDS, Message
from rackhand.schemas.service import WORLD

M = TypeVar("M", bound=Message)
Q = TypeVar("Q", bound=Message)
R = TypeVar("R", bound=Message)

Role = Literal["driver", "localiser", "planner", "controller", "sim", "gateway", "viewer", "node"]
"""What a process does on the bus. The simulator has the roles sim, driver and localiser; ``node`` is any program of a
user that is allowed to take part."""
Owner = Literal["chassis", "arm", "lift", "world", "any"]
"""Whose name is in a key: that of a mobile robot, of an arm, of a lift, ``world``, or any of them (``cell`` too)."""


class Qos(Enum):
    """How a topic is carried.

    ``STREAM``: newest wins, a slow reader loses old samples. ``COMMAND``: never dropped on the way, ahead of data.
    ``EVENT``: every one arrives, in order. ``LATCHED``: like events, and a late subscriber gets the last one at once.
    """

    STREAM = "stream"
    COMMAND = "command"
    EVENT = "event"
    LATCHED = "latched"


@dataclass(frozen=True)
class Topic(Generic[M]):
    """A published topic.

    ``key`` has ``{robot}`` where the name of its ``owner`` goes. ``publisher`` is the one role that may publish it (for
    a command: the one commander), ``readers`` are the roles that subscribe to it; any node may, too. ``rate`` in Hz of
    simulation time, 0 = on change. ``ws``: the gateway's WebSocket topics that change with it.
    """

    name: str
    key: str
    owner: Owner
    model: type[M]
    publisher: Role | Literal["every service"]
    readers: tuple[Role, ...]
    rate: float
    qos: Qos
    text: str
    ws: tuple[type[ws.WsTopic], ...] = ()

    def key_for(self, robot: str) -> str:
        return self.key.format(robot=robot)

    @property
    def period_ns(self) -> int:
        """Nanoseconds between two messages; 0 for a topic that is published on change."""
        return round(NANOSECONDS / self.rate) if self.rate else 0


@dataclass(frozen=True)
class Query(Generic[Q, R]):
    """A query: a request model in, a reply model out, a ``Refusal`` as the error.

    ``server`` answers it, ``callers`` are the roles that may ask.
    """

    name: str
    key: str
    owner: Owner
    request: type[Q]
    reply: type[R]
    server: Role
    callers: tuple[Role, ...]
    text: str

    def key_for(self, robot: str) -> str:
        return self.key.format(robot=robot)


def _chassis(
    name: str,
    model: type[M],
    publisher: Role,
    readers: tuple[Role, ...],
    rate: float,
    qos: Qos,
    text: str,
    *views: type[ws.WsTopic],
) -> Topic[M]:
    return Topic(name, f"rackhand/{{robot}}/{name}", "chassis", model, publisher, readers, rate, qos, text, views)


def _arm(
    name: str, model: type[M], publisher: Role, readers: tuple[Role, ...], rate: float, qos: Qos, text: str
) -> Topic[M]:
    return Topic(name, f"rackhand/{{robot}}/{name}", "arm", model, publisher, readers, rate, qos, text)


def _world(name: str, model: type[M], readers: tuple[Role, ...], rate: float, qos: Qos, text: str) -> Topic[M]:
    return Topic(name, f"rackhand/world/{name}", "world", model, "sim", readers, rate, qos, text)


# fmt: off
ODOMETRY = _chassis("chassis/odometry", chassis.Odometry, "driver", ("planner", "gateway", "viewer"), 50, Qos.STREAM,
                    "wheel odometry; published last of the measurements of a control step", ws.MotionMetrics,
                    ws_sensors.FusedSensorState, ws_sensors.TravelledDistance)
SCAN = _chassis("chassis/scan", chassis.Scan, "driver", ("planner", "gateway", "viewer"), 12.5, Qos.STREAM,
                "2-D lidar", ws.MatchedPoints, ws_sensors.MatchedLaser, ws_sensors.Trajectory)
IMU = _chassis("chassis/imu", chassis.Imu, "driver", (), 50, Qos.STREAM, "angular velocity and specific force")
JACK = _chassis("chassis/jack", chassis.Jack, "driver", ("planner", "gateway", "viewer"), 5, Qos.STREAM,
                "jack state and progress", ws.JackState)
BATTERY = _chassis("chassis/battery", chassis.Battery, "driver", ("planner", "gateway", "viewer"), 1, Qos.STREAM,
                   "charge, voltage, current", ws.BatteryState, ws_sensors.DetailedBatteryState)
CONTACTS = _chassis("chassis/contacts", chassis.Contacts, "driver", ("planner", "gateway", "viewer"), 10, Qos.STREAM,
                    "bumpers, charging contacts, cable, stop button", ws_sensors.BumperState)
CHASSIS_MODEL = _chassis("chassis/model", chassis.ChassisModel, "driver", ("planner", "gateway", "viewer"), 0,
                         Qos.LATCHED, "footprint, limits, lidar, jack and charge contact")
POSE = _chassis("chassis/pose", chassis.LocalisedPose, "localiser", ("planner", "gateway", "viewer"), 25, Qos.STREAM,
                "localised pose in the map", ws.TrackedPose, ws.SlamState, ws.MatchedPoints, ws_sensors.MatchedLaser,
                ws_sensors.Trajectory, ws_racks.LoadFrame)
CHASSIS_STATUS = _chassis("chassis/status", chassis.ChassisStatus, "planner", ("gateway", "viewer"), 0, Qos.LATCHED,
                          "mode, stops, self-check of the jack, alerts", ws.WheelState, ws.ChassisState, ws.Alerts,
                          ws.JackState, ws_sensors.SensorManagerState)
FOOTPRINT = _chassis("chassis/footprint", chassis.ChassisFootprint, "planner", ("gateway", "viewer"), 0, Qos.LATCHED,
                     "outline that must not touch anything now: of the body, or of body and carried rack",
                     ws.RobotModel, ws.RobotFootprint, ws_sensors.LocalPath)
LOAD = _chassis("chassis/load", racks.LoadReport, "planner", ("gateway", "viewer"), 0, Qos.LATCHED,
                "what the chassis carries or is connected to", ws_racks.LoadFrame)
COMMAND = _chassis("chassis/command", chassis.ChassisCommand, "planner", ("driver", "viewer"), 25, Qos.COMMAND,
                   "body velocity and jack")
COSTMAP = _chassis("chassis/costmap", chassis.Costmap, "planner", ("gateway", "viewer"), 1, Qos.STREAM,
                   "local costmap", ws.CostmapFrame, ws_sensors.CostmapPicture)
PLANNING_STATE = _chassis("moves/planning_state", moves.PlanningState, "planner", ("gateway", "viewer"), 5,
                          Qos.LATCHED, "state of the current or last move", ws.PlanningStateFrame)
PATH = _chassis("moves/path", moves.PlannedPath, "planner", ("gateway", "viewer"), 5, Qos.LATCHED, "remaining path",
                ws.PathFrame, ws_sensors.LocalPath)
MOVE_EVENT = _chassis("moves/event", moves.MoveEvent, "planner", ("viewer",), 0, Qos.EVENT,
                      "a move was created, replanned, blocked or has ended")
DETECTED_RACK = _chassis("racks/detected", racks.DetectedRack, "planner", ("gateway", "viewer"), 0, Qos.STREAM,
                         "search for a rack in a scan; only while a search runs", ws_racks.DetectedRackFrame)
DETECTED_RACK_STATES = _chassis("racks/detected_states", racks.RackStates, "planner", ("gateway",), 1,
                                Qos.STREAM, "occupancy of the rack points in view", ws_racks.DetectedRackStates)
MAP_RACK_STATES = _chassis("racks/states", racks.RackStates, "planner", ("gateway", "viewer"), 1, Qos.LATCHED,
                           "occupancy of all rack points of the map, as last seen", ws_racks.MapRackStates)
SEEN_RACKS = _chassis("racks/seen", racks.SeenRacks, "planner", ("gateway", "viewer"), 1, Qos.LATCHED,
                      "racks that scans have shown, with their measured poses", ws_racks.SeenRacksFrame)
MAP = _chassis("map", maps.CurrentMap, "planner", ("gateway", "viewer"), 0, Qos.LATCHED, "map in use, with overlays",
               ws.MapFrame, ws.MapFileFrame, ws.MapInfo, ws.SlamState)

ARM_STATE = _arm("arm/state", motion.ArmState, "driver", ("controller",), 500, Qos.STREAM,
                 "joint positions, velocities, efforts, flange wrench; at the period of a controller that has joined")
ARM_MODEL = _arm("arm/model", motion.ArmModel, "driver", ("viewer",), 0, Qos.LATCHED, "arm profile, pose of the base")
ARM_COMMAND = _arm("arm/command", motion.ArmCommand, "controller", ("driver",), 250, Qos.COMMAND,
                   "joint positions, velocities or torques, with the fencing token")
MOTION_STATUS = _arm("motion/status", motion.MotionStatus, "controller", ("viewer",), 25, Qos.STREAM,
                     "the arm's CRF status")
MOTION_EVENT = _arm("motion/event", motion.MotionEvent, "controller", ("gateway", "viewer"), 0, Qos.EVENT,
                    "control granted and lost, stops")
MOTION_PATH = _arm("motion/path", motion.MotionPath, "controller", ("viewer",), 0, Qos.LATCHED,
                   "path of the tool through all queued waypoints")
MOTION_DIAGNOSTICS = _arm("motion/diagnostics", motion.MotionDiagnostics, "controller", ("viewer",), 25, Qos.STREAM,
                          "tracking errors, duration of ticks and of the solver, late ticks")
MOTION_STREAM = _arm("motion/stream", motion.MotionStream, "controller", ("gateway",), 0, Qos.EVENT,
                     "status streams, one per session")
MOTION_SESSION = _arm("motion/session", motion.SessionGone, "gateway", ("controller",), 0, Qos.EVENT,
                      "the connection of a client was closed")

LIFT_STATE = Topic("lift/state", "rackhand/{robot}/lift/state", "lift", lift.LiftState, "driver",
                   ("gateway", "viewer"), 5, Qos.STREAM, "floor, doors, who has the lift", (ws_lifts.LiftStates,))
LIFT_MODEL = Topic("lift/model", "rackhand/{robot}/lift/model", "lift", lift.LiftModel, "driver",
                   ("gateway", "viewer"), 0, Qos.LATCHED, "floors, cabin and door of a lift")

BUS_STATS = Topic("bus/stats", "rackhand/{robot}/bus/stats", "any", service.BusStats, "every service", ("viewer",), 0,
                  Qos.STREAM, "samples that a service received, lost and could not parse, per second of wall time")

CLOCK = _world("clock", world.Clock, ("planner", "controller", "gateway", "viewer"), 50, Qos.STREAM,
               "simulation time, speed, paused")
OBJECTS = _world("objects", world.Objects, ("viewer",), 25, Qos.STREAM, "ground-truth poses of robots and objects")
SCENE = _world("scene", world.Scene, ("viewer",), 0, Qos.LATCHED, "geometry of the world, for viewers")

MOVES = Query("moves/command", "rackhand/{robot}/moves/command", "chassis", moves.MoveRequest, moves.MoveReply,
              "planner", ("gateway", "node"), "create, get, list, cancel moves")
EXPLAIN = Query("moves/explain", "rackhand/{robot}/moves/explain", "chassis", explain.ExplainMove,
                explain.ExplainReply, "planner", ("gateway", "node"), "why a move failed, waits or is slow")
MOVE_RECORDING = Query("viewer/move_recording", "rackhand/{robot}/viewer/move_recording", "any", explain.RecordMove,
                       explain.MoveRecording, "viewer", ("gateway", "node"),
                       "an explained move as a Rerun recording; the name in the key is cell")
CHASSIS_REQUEST = Query("chassis/request", "rackhand/{robot}/chassis/request", "chassis", chassis.ChassisRequest,
                        chassis.Done, "planner", ("gateway", "node"),
                        "jack, control mode, emergency stop, remote twist, target to follow, set pose")
CHASSIS_PARAMETERS = Query("chassis/parameters", "rackhand/{robot}/chassis/parameters", "chassis",
                           parameters.ParametersRequest, parameters.ParametersReply, "planner", ("gateway", "node"),
                           "parameters that a chassis drives with: read, change")
MAPS = Query("maps", "rackhand/{robot}/maps", "chassis", maps.MapRequest, maps.MapReply, "planner",
             ("gateway", "node"), "the robot's map store and the choice of the current map")
MOTION = Query("motion/command", "rackhand/{robot}/motion/command", "arm", motion.CrfCall, motion.CrfAnswer,
               "controller", ("gateway", "node"), "CRF requests")
MOTION_STOP = Query("motion/stop", "rackhand/{robot}/motion/stop", "arm", motion.CrfCall, motion.CrfAnswer,
                    "controller", ("gateway", "node"), "softStop and hardStop, not queued behind other requests")
LIFT = Query("lift/command", "rackhand/{robot}/lift/command", "lift", lift.LiftRequest, lift.LiftState, "driver",
             ("gateway", "node"), "call a lift, hold its doors, go to a floor, release it")
WORLD_CONTROL = Query("world/control", "rackhand/world/control", "world", world.WorldRequest, world.WorldReply, "sim",
                      ("planner", "controller", "gateway", "node"),
                      "join, pause, advance, speed, reset, place, faults, inspect")
# fmt: on

TOPICS: tuple[Topic[Any], ...] = tuple(row for row in list(globals().values()) if isinstance(row, Topic))
QUERIES: tuple[Query[Any, Any], ...] = tuple(row for row in list(globals().values()) if isinstance(row, Query))


def published_by(*roles: Role, owner: Owner | None = None) -> tuple[Topic[Any], ...]:
    """The topics that a process with these roles publishes; with ``owner``, only those under names of that kind.

    ``BUS_STATS``, which the bus publishes for every service, is not among them.
    """
    return tuple(topic for topic in _owned(owner) if topic.publisher in roles)


def read_by(*roles: Role, owner: Owner | None = None) -> tuple[Topic[Any], ...]:
    """The topics that a process with these roles subscribes to; with ``owner``, only those under names of that kind."""
    return tuple(topic for topic in _owned(owner) if set(topic.readers) & set(roles))


def served_by(role: Role) -> tuple[Query[Any, Any], ...]:
    """The queries that a role answers."""
    return tuple(query for query in QUERIES if query.server == role)


def websocket_topics() -> tuple[type[ws.WsTopic], ...]:
    """Every topic of the gateway's chassis WebSocket, each once."""
    return tuple(dict.fromkeys(view for topic in TOPICS for view in topic.ws))


def _owned(owner: Owner | None) -> Iterable[Topic[Any]]:
    return (topic for topic in TOPICS if owner is None or topic.owner == owner)


__all__ = ["QUERIES", "TOPICS", "WORLD", "Qos", "Query", "Topic", "published_by", "read_by", "served_by"]
