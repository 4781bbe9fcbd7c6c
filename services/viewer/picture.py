"""Which view draws which topic."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.schemas.scan_points import KNOWN_POSES
from rackhand.schemas.topics import Qos, Topic, read_by
from rackhand.services.viewer.arm import ArmMount, ArmView
from rackhand.services.viewer.bus_view import BusView
from rackhand.services.viewer.chassis import ChassisView
from rackhand.services.viewer.geometry import Bounds
from rackhand.services.viewer.items import Item
from rackhand.services.viewer.lift import LiftView
from rackhand.services.viewer.world import WorldView

V = TypeVar("V", bound="View")
M = TypeVar("M", bound=Message)


class View(Protocol):
    """Draws the messages of one robot's part."""

    def __init__(self, robot: str) -> None: ...

    def begin(self) -> Iterable[Item]: ...


@dataclass(frozen=True)
class Route:
    """The view that draws a topic, and its method that does."""

    view: type[Any]
    draw: Callable[[Any, Any], Iterable[Item]]


ROUTES: dict[str, Route] = {}


def draws(topic: Topic[M], view: type[V], draw: Callable[[V, M], Iterable[Item]]) -> None:
    """Have ``view.draw`` draw a topic's messages; that their types fit is checked statically."""
    ROUTES[topic.name] = Route(view, draw)


draws(topics.ODOMETRY, ChassisView, ChassisView.odometry)
draws(topics.SCAN, ChassisView, ChassisView.scan)
draws(topics.JACK, ChassisView, ChassisView.jack)
draws(topics.BATTERY, ChassisView, ChassisView.battery)
draws(topics.CONTACTS, ChassisView, ChassisView.contacts)
draws(topics.CHASSIS_MODEL, ChassisView, ChassisView.model)
draws(topics.POSE, ChassisView, ChassisView.pose)
draws(topics.CHASSIS_STATUS, ChassisView, ChassisView.status)
draws(topics.COMMAND, ChassisView, ChassisView.command)
draws(topics.COSTMAP, ChassisView, ChassisView.costmap)
draws(topics.PLANNING_STATE, ChassisView, ChassisView.planning_state)
draws(topics.PATH, ChassisView, ChassisView.path)
draws(topics.MOVE_EVENT, ChassisView, ChassisView.event)
draws(topics.MAP, ChassisView, ChassisView.map)
draws(topics.FOOTPRINT, ChassisView, ChassisView.outline)
draws(topics.LOAD, ChassisView, ChassisView.load)
draws(topics.DETECTED_RACK, ChassisView, ChassisView.detected_rack)
draws(topics.SEEN_RACKS, ChassisView, ChassisView.seen_racks)
draws(topics.MAP_RACK_STATES, ChassisView, ChassisView.rack_states)
draws(topics.ARM_MODEL, ArmView, ArmView.model)
draws(topics.MOTION_STATUS, ArmView, ArmView.status)
draws(topics.MOTION_EVENT, ArmView, ArmView.event)
draws(topics.MOTION_PATH, ArmView, ArmView.path)
draws(topics.MOTION_DIAGNOSTICS, ArmView, ArmView.diagnostics)
draws(topics.LIFT_MODEL, LiftView, LiftView.model)
draws(topics.LIFT_STATE, LiftView, LiftView.state)
draws(topics.BUS_STATS, BusView, BusView.stats)
draws(topics.CLOCK, WorldView, WorldView.clock)
draws(topics.OBJECTS, WorldView, WorldView.objects)
draws(topics.SCENE, WorldView, WorldView.scene)


def drawn_topics() -> tuple[Topic[Any], ...]:
    """What the table of topics has the viewer read. Raises ``LookupError`` for a topic that nothing draws."""
    if missing := [topic.name for topic in read_by("viewer") if topic.name not in ROUTES]:
        raise LookupError(f"no view draws {', '.join(missing)}")
    return read_by("viewer")


def newest_topics() -> dict[Topic[Any], int]:
    """The topics of which only the newest messages are drawn, and how many: one, but several poses, so that one of
    the scan's time is among them. Poses come first.
    """
    streams = (topic for topic in drawn_topics() if topic.qos in (Qos.STREAM, Qos.COMMAND))
    return {topics.POSE: KNOWN_POSES // 2} | {topic: 1 for topic in streams if topic is not topics.POSE}


@dataclass(frozen=True)
class RobotSet:
    """The robots that are drawn, the base of each arm, the lifts, and the lowest and highest corner of the hall."""

    chassis: tuple[str, ...] = ()
    arms: tuple[str, ...] = ()
    mounts: tuple[ArmMount, ...] = ()
    lifts: tuple[str, ...] = ()
    bounds: tuple[tuple[float, ...], ...] | None = None


class Picture:
    """Everything drawn of one run."""

    def __init__(self) -> None:
        self._views: dict[tuple[type[Any], str], Any] = {}

    def on_message(self, topic: Topic[Any], robot: str, message: Any) -> list[Item]:
        """What a message changes in the picture."""
        route = ROUTES[topic.name]
        view, items = self._views.get((route.view, robot)), []
        if view is None:
            view = self._views[route.view, robot] = route.view(robot)
            items += view.begin()
        return [*items, *route.draw(view, message)]

    @property
    def cast(self) -> RobotSet:
        chassis, arms = self._of(ChassisView), self._of(ArmView)
        worlds = self._of(WorldView).values()
        return RobotSet(
            tuple(sorted(chassis)),
            tuple(sorted(arms)),
            tuple(view.mount for _, view in sorted(arms.items())),
            tuple(sorted(self._of(LiftView))),
            _rounded(next((world.bounds for world in worlds), None)),
        )

    def _of(self, kind: type[V]) -> dict[str, V]:
        return {robot: view for (_, robot), view in self._views.items() if isinstance(view, kind)}


def _rounded(bounds: Bounds | None) -> tuple[tuple[float, ...], ...] | None:
    return None if bounds is None else tuple(tuple(corner) for corner in bounds.round(1).tolist())
