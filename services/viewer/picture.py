"""What is drawn of which message: routed by the contract's own names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from rackhand.schemas import topics
from rackhand.schemas.topics import Qos, Topic
from rackhand.services.viewer.arm import ArmView, Stand
from rackhand.services.viewer.bus_view import BusView
from rackhand.services.viewer.chassis import KNOWN_POSES, ChassisView
from rackhand.services.viewer.geometry import Bounds
from rackhand.services.viewer.items import Item
from rackhand.services.viewer.world import WorldView

V = TypeVar("V")


class View(Protocol):
    """Draws the messages of one robot's part. A method named as the last part of a topic's name takes its messages."""

    def begin(self) -> Iterable[Item]: ...


# The first part of a topic's name says who draws it.
_VIEWS: dict[str, type[Any]] = {
    "chassis": ChassisView,
    "moves": ChassisView,
    "map": ChassisView,
    "arm": ArmView,
    "motion": ArmView,
    "bus": BusView,
    "clock": WorldView,
    "objects": WorldView,
    "scene": WorldView,
}
NOT_DRAWN = {
    topics.IMU: "odometry and pose tell more",
    topics.ARM_STATE: "500 Hz; motion/status has the same numbers at 25",
    topics.ARM_COMMAND: "motion/diagnostics tells how well it is followed",
    topics.MOTION_STREAM: "for the session that asked for it",
    topics.MOTION_SESSION: "for the controller",
}
DRAWN: tuple[Topic[Any], ...] = tuple(topic for topic in topics.TOPICS if topic not in NOT_DRAWN)


# Of streams only the newest is drawn, but a scan where the robot was then: poses come first, and more than one of them.
NEWEST: dict[Topic[Any], int] = {topics.POSE: KNOWN_POSES // 2} | {
    topic: 1 for topic in DRAWN if topic.qos in (Qos.STREAM, Qos.COMMAND) and topic is not topics.POSE
}


@dataclass(frozen=True)
class RobotSet:
    """Who is to be seen, where each arm stands, and the lowest and highest corner of the building."""

    chassis: tuple[str, ...] = ()
    arms: tuple[str, ...] = ()
    stands: tuple[Stand, ...] = ()
    bounds: tuple[tuple[float, ...], ...] | None = None


class Picture:
    """Everything drawn of one run."""

    def __init__(self) -> None:
        self._views: dict[tuple[type[Any], str], Any] = {}

    def on_message(self, topic: Topic[Any], robot: str, message: Any) -> list[Item]:
        """What a message changes in the picture."""
        kind, method = route(topic)
        view, items = self._views.get((kind, robot)), []
        if view is None:
            view = self._views[kind, robot] = kind(robot)
            items += view.begin()
        return [*items, *getattr(view, method)(message)]

    @property
    def cast(self) -> RobotSet:
        chassis, arms = self._of(ChassisView), self._of(ArmView)
        worlds = self._of(WorldView).values()
        return RobotSet(
            tuple(sorted(chassis)),
            tuple(sorted(arms)),
            tuple(view.stand for _, view in sorted(arms.items())),
            _rounded(next((world.bounds for world in worlds), None)),
        )

    def _of(self, kind: type[V]) -> dict[str, V]:
        return {robot: view for (_, robot), view in self._views.items() if isinstance(view, kind)}


def route(topic: Topic[Any]) -> tuple[type[Any], str]:
    """The view that draws a topic, and the name of its method."""
    first, _, last = topic.name.partition("/")
    return _VIEWS[first], last or first


def _rounded(bounds: Bounds | None) -> tuple[tuple[float, ...], ...] | None:
    return None if bounds is None else tuple(tuple(corner) for corner in bounds.round(1).tolist())
