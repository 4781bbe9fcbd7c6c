"""One chassis: its moves, modes, maps and jack in one place. Messages in, commands and publications out."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field

from rackhand.schemas.base import NANOSECONDS, Message, Pose2, Twist2
from rackhand.schemas.chassis import (
    ChassisCommand,
    ChassisModel,
    ChassisRequest,
    ChassisStatus,
    Contacts,
    Done,
    JackRequest,
    Odometry,
    RemoteTwist,
    SetControlMode,
    SetEmergencyStop,
    SetPose,
)
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import MapReply, MapRequest
from rackhand.schemas.moves import (
    CancelMove,
    CreateMove,
    GetMove,
    ListMoves,
    MoveCreate,
    MoveReply,
    MoveRequest,
    PlanningState,
)
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.schemas.world import Clock
from rackhand.services.planner.alerts import active_alerts
from rackhand.services.planner.behaviors.interface import Navigator, Progress
from rackhand.services.planner.behaviors.runner import PATIENCE_NS, MoveRunner
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.jacking import JackOrders
from rackhand.services.planner.map.service import MapService
from rackhand.services.planner.map.store import MapStore
from rackhand.services.planner.modes import Modes, RemoteLimits, ramp
from rackhand.services.planner.moves.book import EndState, MoveBook, MoveRecords
from rackhand.services.planner.perception.chassis_state import ChassisState, Observation
from rackhand.services.planner.reports import Publication, Reports

PERIOD_NS = 40_000_000  # between commands
AT_REST = 0.01  # m/s and rad/s: a command below it is none


@dataclass(frozen=True)
class ChassisSettings:
    """``patience_ns``: how long a move stands without a position, say, before it fails."""

    remote: RemoteLimits = field(default_factory=RemoteLimits)
    patience_ns: int = PATIENCE_NS
    period_ns: int = PERIOD_NS


class Chassis:
    """The core of the planner. Requests are answered at once; what moves, moves in ``tick``.

    Requests raise ``RequestRefused``. Whatever is to be told piles up in ``take_publications``.
    """

    def __init__(
        self, navigator: Navigator, moves: MoveRecords, maps: MapStore, settings: ChassisSettings | None = None
    ) -> None:
        self._settings = settings or ChassisSettings()
        self._navigator = navigator
        self._book = MoveBook(moves)
        self._maps = MapService(maps, navigator)
        self._runner = MoveRunner(navigator, self._settings.patience_ns)
        self._modes = Modes(self._settings.remote)
        self._jack = JackOrders()
        self._sensed = ChassisState()
        self._reports = Reports()
        self._progress: Progress | None = None
        self._distance = 0.0
        self._target = None if self._book.last is None else _asked(self._book.last)
        self._commanded = STANDSTILL
        self._unix_ns: int | None = None
        self._stamp = 0
        self._driver_fault = "the chassis driver is not connected"
        self._maps.load()
        self._reports.map(self._stamp, self._maps.current)
        self._report()

    # -- what is heard -----------------------------------------------------------------------------------------------

    @property
    def ready(self) -> bool:
        """The body is known: nothing else is missing to answer the driver."""
        return self._sensed.model is not None

    def on_message(self, message: Message) -> None:
        """A measurement of the driver or the localiser."""
        if isinstance(message, ChassisModel) and not self._is_known(message):
            self._navigator.set_model(message)
        self._sensed.take(message)
        match message:
            case Contacts(emergency_stop_button=pressed):
                self._modes.stop(pressed=pressed)
            case Odometry(stamp=stamp):
                self._stamp = stamp

    def _is_known(self, model: ChassisModel) -> bool:
        known = self._sensed.model
        return known is not None and known.model_dump() == model.model_dump()

    def on_clock(self, clock: Clock) -> None:
        self._unix_ns, self._stamp = clock.unix_ns, clock.stamp

    def reset(self, why: str) -> None:
        """The driver has gone or begun another run: a running move fails, and all that was measured is void."""
        self._fail(MoveFailReason.PLATFORM_ALERT_ERROR, f"{why} during the move")
        self._sensed.forget()
        self._navigator.reset()
        self._jack.forget()
        self._modes.forget_remote_twist()
        self._commanded = STANDSTILL
        self._maps.load()
        self._report()

    def set_driver_fault(self, fault: str) -> None:
        """Why the driver is not alive, empty when it is: without it no move begins."""
        self._driver_fault = fault
        self._report()

    def store_failed(self, move_id: int | None, maps_undone: bool, why: str) -> None:
        """A change could not be written: a move that is not on disk ends, maps are again as they are on disk."""
        if move_id is not None and self._book.current is not None and self._book.current.id == move_id:
            self._fail(MoveFailReason.INTERNAL_ERROR, f"the move could not be stored: {why}")
        if maps_undone:
            self._maps.load()
            self._reports.map(self._stamp, self._maps.current)
        self._report()

    def take_publications(self) -> list[Publication]:
        return self._reports.take()

    # -- ticks -------------------------------------------------------------------------------------------------------

    def tick(self) -> ChassisCommand:
        """The command that answers the last odometry. Raises ``LookupError`` before any."""
        if self._sensed.odometry is None:
            raise LookupError("no odometry to answer")
        seen, stamp = self._sensed.observation(), self._sensed.odometry.stamp
        self._stamp = stamp
        self._commanded = self._idle(seen) if self._book.current is None else self._drive(seen)
        may_jack = self._commanded == STANDSTILL and self._measured_at_rest() and not self._modes.emergency_stop
        jack = self._jack.command(self._sensed.jack, stamp, may_jack)
        self._report()
        if self._reports.is_costmap_due(stamp):
            self._reports.costmap(stamp, self._navigator.costmap(stamp))
        return ChassisCommand(answers=stamp, twist=self._commanded, jack=jack)

    def fail_internally(self, error: Exception) -> ChassisCommand:
        """In place of a ``tick`` that raised: end the move, and brake without the help of what may be broken."""
        self._distance = 0.0
        with contextlib.suppress(Exception):  # the navigator and the store may be what is broken; the move is over
            self._fail(MoveFailReason.INTERNAL_ERROR, f"{type(error).__name__}: {error}"[:500])
        self._commanded = _at_rest(self._ramp_to(STANDSTILL))
        self._report()
        return ChassisCommand(answers=self._stamp, twist=self._commanded)

    def _drive(self, seen: Observation | None) -> Twist2:
        if self._modes.control_mode != "auto":
            self._end("cancelled", note=f"moves run in control mode auto, not {self._modes.control_mode}")
            return self._rest(seen)
        try:
            progress = self._runner.step(
                seen,
                self._stamp,
                forbidden=self._forbidden(),
                hold=self._modes.emergency_stop,
                trouble=self._trouble(),
            )
        except MoveFailed as failed:
            self._fail(failed.reason, failed.text)
            return self._rest(seen)
        if progress is None:
            return self._rest(seen)
        self._note(progress)
        if progress.arrived:
            self._end("succeeded")
        return progress.twist

    def _forbidden(self) -> MoveFailed | None:
        if self._sensed.power_cable:
            return MoveFailed(MoveFailReason.POWER_CABLE_CONNECTED, "a power cable is plugged into the chassis")
        if self._maps.trouble is not None:
            return MoveFailed(MoveFailReason.GET_MAP_FAILED, self._maps.trouble)
        if self._maps.current is None:
            return MoveFailed(MoveFailReason.GET_MAP_FAILED, "no map is in use; select one first")
        return None

    def _trouble(self) -> str | None:
        if self._sensed.model is None:
            return "the driver has not told the footprint of the chassis"
        return self._sensed.pose_trouble()

    def _idle(self, seen: Observation | None) -> Twist2:
        if self._modes.control_mode != "remote" or self._modes.emergency_stop or self._sensed.power_cable:
            return self._rest(seen)
        self._observe(seen)
        wanted = STANDSTILL if self._jack.active else self._modes.remote_twist(self._stamp)
        return self._ramp_to(wanted)

    def _observe(self, seen: Observation | None) -> None:
        if seen is not None and self._trouble() is None:
            self._navigator.observe(seen)

    def _rest(self, seen: Observation | None) -> Twist2:
        """Come to rest, or stay there. Navigation either looks or brakes: braking looks too."""
        if self._commanded == STANDSTILL:
            self._observe(seen)
            return STANDSTILL
        return _at_rest(self._ramp_to(STANDSTILL) if seen is None else self._navigator.brake(seen))

    def _ramp_to(self, wanted: Twist2) -> Twist2:
        return ramp(self._commanded, wanted, self._settings.remote, self._settings.period_ns / NANOSECONDS)

    def _measured_at_rest(self) -> bool:
        odometry = self._sensed.odometry
        return odometry is not None and max(abs(odometry.twist.linear), abs(odometry.twist.angular)) < 5 * AT_REST

    def _note(self, progress: Progress) -> None:
        move = self._book.current
        before, self._progress = self._progress, progress
        self._distance = progress.remaining_distance
        if move is None:
            return
        if progress.replanned:
            text = f"{progress.remaining_distance:.2f} m to go"
            self._reports.event(self._stamp, move.id, "replanned", text)
        was_stuck = before is not None and before.stuck_state != "none"
        if was_stuck != (progress.stuck_state != "none"):
            text = "" if was_stuck else progress.stuck_state
            self._reports.event(self._stamp, move.id, "unblocked" if was_stuck else "blocked", text)

    # -- requests ----------------------------------------------------------------------------------------------------

    def moves(self, request: MoveRequest) -> MoveReply:
        match request.request:
            case CreateMove(move=wanted):
                self._create(wanted)
                return MoveReply(moves=(self._book.get(None),))
            case GetMove(id=move_id):
                return MoveReply(moves=(self._book.get(move_id),))
            case ListMoves(offset=offset, limit=limit):
                return MoveReply(moves=self._book.page(offset, limit))
            case CancelMove(id=move_id):
                move = self._book.cancellable(move_id)
                self._end("cancelled", note="cancelled on request")
                return MoveReply(moves=(self._book.get(move.id),))

    def _create(self, wanted: MoveCreate) -> None:
        if self._driver_fault:
            raise RequestRefused(RefusalCode.UNAVAILABLE, self._driver_fault)
        if (direction := self._jacking()) is not None:
            raise RequestRefused(RefusalCode.PRECONDITION, f"the jack is going {direction}; wait until it has arrived")
        move, replaced = self._book.create(wanted, self._now())
        self._runner.begin(wanted)
        self._progress, self._distance, self._target = None, 0.0, _asked(wanted)
        if replaced is not None:
            self._reports.event(self._stamp, replaced.id, "replaced", f"replaced by move {move.id}")
        self._reports.event(self._stamp, move.id, "created", move.type)
        self._report()

    def maps(self, request: MapRequest) -> MapReply:
        before, changes = self._maps.current, self._maps.changes
        reply = self._maps.answer(request, self._now())
        current = self._maps.current
        if changes != self._maps.changes:
            what = "the map was cleared" if current is None else f"the map was changed to {current.map_name!r}"
            self._fail(MoveFailReason.MAP_CHANGED, f"{what} during the move")
        if before is not current or changes != self._maps.changes:
            self._reports.map(self._stamp, current)
            self._report()
        return reply

    def chassis(self, request: ChassisRequest) -> Done:
        detail = ""
        match request.request:
            case SetControlMode(control_mode=mode):
                self._modes.set_control_mode(mode)
                if mode != "auto" and self._book.current is not None:
                    self._end("cancelled", note=f"the control mode was set to {mode}")
            case SetEmergencyStop(enable=enable):
                self._modes.stop(requested=enable)
                if not enable and self._modes.stop_pressed:
                    detail = "the emergency-stop button is still pressed"
            case RemoteTwist(twist=twist):
                if self._sensed.power_cable:
                    raise RequestRefused(RefusalCode.PRECONDITION, "a power cable is plugged into the chassis")
                self._modes.take_remote_twist(twist, self._stamp)
            case JackRequest(direction=direction):
                if self._book.current is not None:
                    raise RequestRefused(
                        RefusalCode.PRECONDITION, f"move {self._book.current.id} runs; the jack waits for its end"
                    )
                if self._modes.emergency_stop:
                    raise RequestRefused(RefusalCode.PRECONDITION, "the emergency stop is on")
                detail = self._jack.request(direction, self._sensed.jack)
            case SetPose():
                detail = self._set_pose()
        self._report()
        return Done(detail=detail)

    def _set_pose(self) -> str:
        """Clients give a first guess after they set a map. The localiser of this version finds the pose by itself."""
        if (trouble := self._sensed.pose_trouble()) is not None:
            raise RequestRefused(RefusalCode.UNAVAILABLE, f"there is no localiser to be told: {trouble}")
        return "not needed: the localiser knows the pose"

    def _jacking(self) -> str | None:
        if self._jack.active is not None:
            return self._jack.active
        state = "hold" if self._sensed.jack is None else self._sensed.jack.state
        return state.removeprefix("jacking_") if state.startswith("jacking_") else None

    def _now(self) -> int:
        """Unix seconds by the messages' clock; without it nothing can be dated."""
        if self._unix_ns is None:
            raise RequestRefused(RefusalCode.UNAVAILABLE, "no clock was received: the chassis driver is not connected")
        return (self._unix_ns + self._stamp) // NANOSECONDS

    # -- ends and reports --------------------------------------------------------------------------------------------

    def _fail(self, reason: MoveFailReason, text: str) -> None:
        if self._book.current is not None:
            self._end("failed", reason, text)

    def _end(
        self, state: EndState, reason: MoveFailReason = MoveFailReason.NONE, text: str = "", note: str = ""
    ) -> None:
        self._progress = None
        try:
            self._navigator.stop()
        finally:
            move = self._book.end(state, self._now(), reason, text)
            told = f"{reason.rest_name}: {text}" if text else note
            self._reports.event(self._stamp, move.id, state, told)
            self._report()

    def _report(self) -> None:
        stamp, progress = self._stamp, self._progress
        stuck = "none" if progress is None else progress.stuck_state
        move, current = self._book.last, self._maps.current
        self._reports.planning(
            PlanningState(
                stamp=stamp,
                map_uid="" if current is None else current.uid,
                action_id=0 if move is None else move.id,
                action_type="none" if move is None else move.type,
                move_state="none" if move is None else move.state,
                fail_reason=0 if move is None else move.fail_reason,
                remaining_distance=self._distance,
                target=self._runner.target or self._target,
                stuck_state=stuck,
                viewport_blocked=progress is not None and progress.viewport_blocked,
            )
        )
        if self._book.current is None or progress is not None:
            self._reports.path(stamp, progress)
        alerts = active_alerts(
            self._sensed,
            moving=self._book.current is not None,
            stuck=stuck != "none",
            jack_failed=self._jack.failed,
            map_trouble=self._maps.trouble,
        )
        self._reports.status(
            ChassisStatus(
                stamp=stamp,
                control_mode=self._modes.control_mode,
                emergency_stop=self._modes.emergency_stop,
                driver_alive=not self._driver_fault,
                alerts=alerts,
            )
        )


def _asked(request: MoveCreate) -> Pose2 | None:
    """The target as it was asked for, until the procedure knows better."""
    if request.target_x is None or request.target_y is None:
        return None
    return Pose2(x=request.target_x, y=request.target_y, yaw=request.target_ori or 0.0)


def _at_rest(twist: Twist2) -> Twist2:
    return STANDSTILL if max(abs(twist.linear), abs(twist.angular)) < AT_REST else twist
