"""What the planner publishes: which message, and when it is due."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Message, Pose2
from rackhand.schemas.chassis import Alert, ChassisFootprint, ChassisStatus, Costmap
from rackhand.schemas.maps import CurrentMap, MapData
from rackhand.schemas.moves import INTENT_MOVE_TYPES, Move, MoveEvent, PlannedPath, PlanningState
from rackhand.schemas.racks import DetectedRack, RackSpec, RackStates, SeenRacks
from rackhand.schemas.topics import Topic
from rackhand.services.planner.behaviors.base import Status
from rackhand.services.planner.behaviors.running import RunningMove
from rackhand.services.planner.geometry.footprint import Footprint, expanded
from rackhand.services.planner.jacking import JackOrders
from rackhand.services.planner.load import Load
from rackhand.services.planner.modes import Modes
from rackhand.services.planner.moves.book import target_of

PERIOD_NS = NANOSECONDS // 5
COSTMAP_PERIOD_NS = NANOSECONDS


@dataclass(frozen=True)
class Publication:
    """A message to be published."""

    topic: Topic[Any]
    message: Message


class Reports:
    """Collects publications: changes at once, progress at 5 Hz of simulation time."""

    def __init__(self) -> None:
        self._due: list[Publication] = []
        self._planning: PlanningState | None = None
        self._status: ChassisStatus | None = None
        self._path = np.empty((0, 3))
        self._path_known, self._path_stamp, self._plans = False, 0, 0
        self._costmap_stamp: int | None = None
        self._footprint: tuple[Footprint, float] | None = None
        self._load: Load | None = None
        self._rack_states: RackStates | None = None
        self._detected_rack: DetectedRack | None = None
        self._seen: list[tuple[Pose2, RackSpec]] | None = None

    def take(self) -> list[Publication]:
        """All that is due now, in order; each once."""
        due, self._due = self._due, []
        return due

    def event(self, stamp: int, move_id: int, event: Any, text: str = "") -> None:
        self._put(topics.MOVE_EVENT, MoveEvent(stamp=stamp, move_id=move_id, event=event, text=text))

    def changes(self, stamp: int, move_id: int, before: Status, now: Status) -> None:
        """An event for each change of a move's status that operators look for."""
        if now.plans > max(before.plans, 1):
            self.event(stamp, move_id, "replanned", f"{now.remaining_distance:.2f} m left")
        was_stuck = before.stuck_state != "none"
        if was_stuck != (now.stuck_state != "none"):
            self.event(
                stamp,
                move_id,
                "unblocked" if was_stuck else "blocked",
                "" if was_stuck else now.notice or now.stuck_state,
            )

    def map(self, stamp: int, data: MapData | None) -> None:
        self._put(topics.MAP, CurrentMap(stamp=stamp, map=data))

    def planning(self, state: PlanningState) -> None:
        """The state of the move: at once when anything but the distance changed, else at 5 Hz while it moves."""
        last = self._planning
        if last is None or _without(last, "remaining_distance") != _without(state, "remaining_distance"):
            due = True
        else:
            due = state.move_state == "moving" and _another_period(last.stamp, state.stamp)
        if due:
            self._planning = state
            self._put(topics.PLANNING_STATE, state)

    def path(self, stamp: int, status: Status) -> None:
        """The path ahead at 5 Hz when it changed, at once when it is a new one or has ended."""
        poses = status.path
        if self._path_known and np.array_equal(poses, self._path):
            return
        urgent = not self._path_known or len(poses) == 0 or status.plans != self._plans
        if urgent or _another_period(self._path_stamp, stamp):
            self._path, self._path_stamp, self._path_known, self._plans = poses.copy(), stamp, True, status.plans
            self._put(topics.PATH, PlannedPath(stamp=stamp, poses=poses))

    def is_costmap_due(self, stamp: int) -> bool:
        last = self._costmap_stamp
        return last is None or last // COSTMAP_PERIOD_NS != stamp // COSTMAP_PERIOD_NS

    def costmap(self, stamp: int, costmap: Costmap | None) -> None:
        self._costmap_stamp = stamp
        if costmap is not None:
            self._put(topics.COSTMAP, costmap)

    def footprint(self, stamp: int, footprint: Footprint | None, expansion: float) -> None:
        """The outline in force, once the chassis is known and when it changed; ``expansion`` in metres."""
        last = self._footprint
        if footprint is None or (last is not None and last[0] is footprint and last[1] == expansion):
            return
        self._footprint = footprint, expansion
        outline = footprint.polygon
        message = ChassisFootprint(stamp=stamp, outline=outline, expanded=expanded(outline, expansion))
        self._put(topics.FOOTPRINT, message)

    def load(self, stamp: int, load: Load) -> None:
        if load is not self._load:
            self._load = load
            self._put(topics.LOAD, load.report(stamp))

    def rack_states(self, detected: RackStates | None, remembered: RackStates | None) -> None:
        """At 1 Hz: what is detected of rack points now; all that is known of them where it has changed."""
        if detected is not None:
            self._put(topics.DETECTED_RACK_STATES, detected)
        if remembered is not None and (
            self._rack_states is None or _without(self._rack_states) != _without(remembered)
        ):
            self._rack_states = remembered
            self._put(topics.MAP_RACK_STATES, remembered)

    def seen_racks(self, seen: SeenRacks) -> None:
        """Where it has changed: poses, not only the times at which they were seen."""
        before, self._seen = self._seen, [(rack.pose, rack.spec) for rack in seen.racks]
        if before != self._seen:
            self._put(topics.SEEN_RACKS, seen)

    def detected_rack(self, found: DetectedRack | None) -> None:
        """What was found in a scan, once."""
        if found is not None and found is not self._detected_rack:
            self._put(topics.DETECTED_RACK, found)
        self._detected_rack = found

    def status(self, status: ChassisStatus) -> None:
        if self._status is None or _without(self._status) != _without(status):
            self._status = status
            self._put(topics.CHASSIS_STATUS, status)

    def _put(self, topic: Topic[Any], message: Message) -> None:
        self._due.append(Publication(topic, message))


def planning_state(
    stamp: int,
    current: MapData | None,
    move: Move | None,
    running: RunningMove | None,
    status: Status,
    remaining_distance: float,
    in_lift: bool = False,
) -> PlanningState:
    """Of the running or last move, which is ``running`` if it has not ended. ``in_lift``: where the chassis is."""
    map_uid = "" if current is None else current.uid
    if move is None:
        return PlanningState(stamp=stamp, map_uid=map_uid)
    # A behaviour that has not said where it drives drives where it was asked to.
    requested, has_intent = target_of(move), move.type in INTENT_MOVE_TYPES
    return PlanningState(
        stamp=stamp,
        map_uid=map_uid,
        action_id=move.id,
        action_type=move.type,
        move_state=move.state,
        fail_reason=move.fail_reason,
        message=(running.held_by if running is not None else None) or status.notice or move.fail_message,
        paused=running is not None and running.paused,
        remaining_distance=remaining_distance,
        target=None if has_intent else status.target or requested,
        move_intent=status.intent,
        intent_target=(status.intent_target or requested) if has_intent else None,
        stuck_state=status.stuck_state,
        viewport_blocked=status.viewport_blocked,
        flags=tuple(sorted(status.flags | ({"in_elevator"} if in_lift else frozenset()))),
        passed_points=status.passed_points,
    )


def chassis_status(
    stamp: int, modes: Modes, jack: JackOrders, driver_alive: bool, alerts: tuple[Alert, ...]
) -> ChassisStatus:
    return ChassisStatus(
        stamp=stamp,
        control_mode=modes.control_mode,
        emergency_stop=modes.emergency_stop,
        driver_alive=driver_alive,
        jack_checking=jack.checking,
        jack_check=jack.check_state,
        alerts=alerts,
    )


def _without(message: Message, *names: str) -> dict[str, Any]:
    return message.model_dump(exclude={"stamp", *names})


def _another_period(last: int, now: int) -> bool:
    return last // PERIOD_NS != now // PERIOD_NS
