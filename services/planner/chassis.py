"""One chassis: its moves, modes, maps and jack in one place. Messages in, commands and publications out."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import replace

from rackhand.schemas.base import NANOSECONDS, Message
from rackhand.schemas.chassis import (
    ChassisCommand,
    ChassisModel,
    ChassisRequest,
    Contacts,
    Done,
    Odometry,
    SetControlMode,
)
from rackhand.schemas.explain import Evidence, ExplainMove, ExplainReply
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import MapReply, MapRequest
from rackhand.schemas.moves import (
    CancelMove,
    ClearMoves,
    CreateMove,
    GetMove,
    ListMoves,
    MoveCreate,
    MoveReply,
    MoveRequest,
    PauseMove,
)
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.schemas.world import Clock
from rackhand.services.planner.alerts import active_alerts
from rackhand.services.planner.behaviors.base import Done as Succeeded
from rackhand.services.planner.behaviors.base import Drive, Status
from rackhand.services.planner.behaviors.running import RunningMove
from rackhand.services.planner.chassis_requests import ChassisRequests
from rackhand.services.planner.chassis_settings import ChassisSettings
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.explainer import Explainer
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.jacking import JackOrders
from rackhand.services.planner.load import LoadRecord, UnkeptLoad
from rackhand.services.planner.map.service import Made, MapService
from rackhand.services.planner.map.store import MapStore
from rackhand.services.planner.modes import Modes
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.moves.book import EndState, MoveBook, MoveRecords
from rackhand.services.planner.moves.explanations import ExplanationRecords, UnkeptExplanations
from rackhand.services.planner.parameters import ParameterService, ParameterStore
from rackhand.services.planner.perception.chassis_state import ChassisState
from rackhand.services.planner.rack_reports import RackReports
from rackhand.services.planner.reports import Publication, Reports, chassis_status, planning_state
from rackhand.services.planner.settings import Limits

PERIOD_NS = 40_000_000  # between commands


class Chassis:
    """The core of the planner. Requests are answered at once; what moves, moves in ``tick``.

    Requests raise ``RequestRefused``. What is to be published accumulates in ``take_publications``.
    """

    def __init__(
        self,
        motion: Motion,
        moves: MoveRecords,
        maps: MapStore,
        parameters: ParameterStore,
        settings: ChassisSettings | None = None,
        load: LoadRecord | None = None,
        explanations: ExplanationRecords | None = None,
    ) -> None:
        """``load``, ``explanations``: where the load state, and explanations of moves, are kept; without them, they
        last as long as the process."""
        self._settings = settings or ChassisSettings()
        self._motion = motion
        self._book = MoveBook(moves)
        self._maps = MapService(maps, motion)
        self.parameters = ParameterService(parameters, motion, self._settings.basis(motion.settings.rack_specs))
        self._modes = Modes(self._settings.remote.twist_life_ns)
        self._jack = JackOrders()
        self._load = load or UnkeptLoad()
        motion.load = self._load.load
        self._explainer = Explainer(motion, explanations or UnkeptExplanations())
        self._state = ChassisState()
        self._reports = Reports()
        self._racks = RackReports(self._reports)
        self._requests = ChassisRequests(self._book, motion, self._modes, self._jack, self._state, self._racks)
        self._status, self._distance = Status(), 0.0
        self._commanded = STANDSTILL
        self._unix_ns: int | None = None
        self._stamp = 0
        self._driver_fault = "the chassis driver is not connected"
        self._maps.load()
        self._reports.map(self._stamp, self._maps.current)
        self._report()

    # -- messages ----------------------------------------------------------------------------------------------------

    @property
    def ready(self) -> bool:
        """The chassis' model is known: nothing else is missing to answer the driver."""
        return self._state.model is not None

    def on_message(self, message: Message) -> None:
        """A measurement of the driver or the localiser."""
        if isinstance(message, ChassisModel) and not self._is_known(message):
            self._motion.set_model(message)
            self.parameters.apply()
        self._state.take(message)
        match message:
            case Contacts(emergency_stop_button=pressed):
                self._modes.stop(pressed=pressed)
            case Odometry(stamp=stamp):
                self._stamp = stamp

    def _is_known(self, model: ChassisModel) -> bool:
        known = self._state.model
        return known is not None and known.model_dump() == model.model_dump()

    def on_clock(self, clock: Clock) -> None:
        self._unix_ns, self._stamp = clock.unix_ns, clock.stamp

    def reset(self, why: str) -> None:
        """The driver is gone or restarted: a running move fails, and all that was measured is void."""
        self._fail(MoveFailReason.PLATFORM_ALERT_ERROR, f"{why} during the move")
        self._state.forget()
        self._motion.reset()
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
        """A change could not be written: a move that is not on disk ends, all else is again as it is on disk."""
        self.parameters.apply()
        if move_id is not None and self._book.current is not None and self._book.current.id == move_id:
            self._fail(MoveFailReason.INTERNAL_ERROR, f"the move could not be stored: {why}")
        if maps_undone:
            self._maps.load()
            self._reports.map(self._stamp, self._maps.current)
        self._report()

    def take_publications(self) -> list[Publication]:
        return self._reports.take()

    # -- ticks -------------------------------------------------------------------------------------------------------

    def tick(self, lockstep: bool) -> ChassisCommand:
        """The command that answers the last odometry: perceive, decide, guard. Raises ``LookupError`` before any.

        ``lockstep``: a plan that was asked for at the tick before is waited for.
        """
        if self._state.odometry is None:
            raise LookupError("no odometry to answer")
        stamp = self._stamp = self._state.odometry.stamp
        self._motion.plans.lockstep = lockstep
        self._motion.perceive(self._state)
        if self._motion.update_load(self._state):
            self._load.save(self._motion.load)
        self.parameters.follow_load(self._state)
        limits = self._motion.settings.control
        if self._book.current is not None:
            wanted = self._step_move()
        else:
            wanted, limits = self._remote(), self._remote_limits().within(limits)
        self._commanded = self._motion.command(wanted, self._state, limits)
        allowed = self.parameters.values.max_forward_velocity
        self._explainer.note(stamp, self._status, self._state.odometry.twist, self._commanded, allowed)
        may_jack = self._commanded == STANDSTILL and self._state.rests and not self._modes.emergency_stop
        jack = self._jack.command(self._state.jack, stamp, may_jack)
        self._report()
        if self._book.current is None:
            self._racks.search(stamp, self._motion)
        if self._reports.is_costmap_due(stamp):
            self._reports.costmap(stamp, self._motion.perception.costmap_message(stamp))
            self._racks.states(stamp, self._motion.perception.costmap, self._maps.current)
        return ChassisCommand(answers=stamp, twist=self._commanded, jack=jack)

    def fail_internally(self, error: Exception) -> ChassisCommand:
        """In place of a ``tick`` that raised: end the move, and brake without the help of what may be broken."""
        self._distance = 0.0
        with contextlib.suppress(Exception):  # the store may be what is broken; the move is over all the same
            self._fail(MoveFailReason.INTERNAL_ERROR, f"{type(error).__name__}: {error}"[:500])
        self._commanded = self._motion.brake(self._stamp)
        self._report()
        return ChassisCommand(answers=self._stamp, twist=self._commanded)

    def _step_move(self) -> Drive | None:
        """One step of the running move, or its end. None: brake."""
        move = self._motion.move
        if move is None:
            raise RuntimeError("the move book has a running move that was never started")
        if self._modes.control_mode != "auto":
            self._end("cancelled", text=f"moves run in control mode auto, not {self._modes.control_mode}")
            return None
        try:
            move.prepare()
            outcome = None if self._is_held(move) else self._motion.step(self._state)
        except MoveFailed as failed:
            self._fail(failed.reason, failed.text, failed.evidence)
            return None
        status = move.status()
        self._note(status if move.held_by is None else replace(status, stuck_state="none"))
        if isinstance(outcome, Succeeded):
            self._end("succeeded")
            return None
        return outcome

    def _is_held(self, move: RunningMove) -> bool:
        """Whether the move must wait this tick. Raises ``MoveFailed`` where waiting cannot help."""
        if self._state.power_cable:
            raise MoveFailed(MoveFailReason.POWER_CABLE_CONNECTED, "a power cable is plugged into the chassis")
        if self._maps.trouble is not None:
            raise MoveFailed(MoveFailReason.GET_MAP_FAILED, self._maps.trouble)
        if self._maps.current is None:
            raise MoveFailed(MoveFailReason.GET_MAP_FAILED, "no map is in use; select one first")
        if (stop := self._stop(move)) is not None:
            move.hold(stop)
        elif (direction := self._jack.moving(self._state.jack)) is not None:
            move.hold_for_jack(direction)
        elif (trouble := self._trouble()) is not None:
            move.wait(trouble, self._stamp)
        else:
            move.check_jack(self._jack.failed)
            return False
        return True

    def _stop(self, move: RunningMove) -> str | None:
        """Who holds the move until he lets it go on."""
        if self._modes.emergency_stop:
            return "the emergency stop is on"
        return "the move is paused on request" if move.paused else self._motion.settings.control.standstill()

    def _trouble(self) -> str | None:
        if self._state.model is None:
            return "the driver has not published the chassis' model"
        return self._state.pose_trouble()

    def _remote(self) -> Drive | None:
        """What remote driving wants; None: brake."""
        if self._modes.control_mode != "remote" or self._modes.emergency_stop or self._state.power_cable:
            return None
        if self._jack.active:
            return None
        twist = self._modes.remote_twist(self._stamp)
        return None if twist == STANDSTILL else Drive(twist)

    def _remote_limits(self) -> Limits:
        fastest = self.parameters.values.remote_max_forward_velocity
        return self._settings.remote.limits._replace(max_forward_velocity=fastest)

    def _note(self, status: Status) -> None:
        """Keep the move's status for reports."""
        if self._book.current is not None:
            self._reports.changes(self._stamp, self._book.current.id, self._status, status)
        self._status, self._distance = status, status.remaining_distance

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
                move = self._book.active(move_id)
                self._end("cancelled", text="cancelled on request")
                return MoveReply(moves=(self._book.get(move.id),))
            case PauseMove(id=move_id, paused=paused):
                move = self._book.active(move_id)
                self._pause(move.id, paused)
                return MoveReply(moves=(move,))
            case ClearMoves():
                self._book.clear()
                return MoveReply(moves=())

    def _create(self, wanted: MoveCreate) -> None:
        if self._driver_fault:
            raise RequestRefused(RefusalCode.UNAVAILABLE, self._driver_fault)
        direction = self._jack.moving(self._state.jack)
        if direction is not None and self.parameters.values.refuse_moves_while_jacking:
            raise RequestRefused(RefusalCode.PRECONDITION, f"the jack is moving {direction}; wait until it has arrived")
        move, replaced = self._book.create(wanted, self._now())
        if replaced is not None:
            self._explainer.end(self._stamp, replaced)
        self._motion.begin(wanted)
        self._explainer.begin(self._stamp)
        self._state.followed = None
        self._status, self._distance = Status(), 0.0
        if replaced is not None:
            self._reports.event(self._stamp, replaced.id, "replaced", f"replaced by move {move.id}")
        self._reports.event(self._stamp, move.id, "created", move.type)
        self._report()

    def explain(self, request: ExplainMove) -> ExplainReply:
        """Why a move failed, waits or is slow."""
        return self._explainer.answer(request, self._book, self._stamp)

    def _pause(self, move_id: int, paused: bool) -> None:
        running = self._motion.move
        if running is not None and running.paused != paused:
            running.paused = paused
            self._reports.event(self._stamp, move_id, "paused" if paused else "resumed")
            self._report()

    def map_work(self, request: MapRequest) -> Callable[[], Made] | None:
        """What takes long of a request about maps, to be called in any thread; see ``MapService.work``."""
        return self._maps.work(request)

    def maps(self, request: MapRequest, made: Made | None = None) -> MapReply:
        """``made``: what ``map_work`` made of it, if it was called before."""
        before, changes = self._maps.current, self._maps.changes
        reply = self._maps.answer(request, self._now(), made)
        current = self._maps.current
        if changes != self._maps.changes:
            what = "the map was cleared" if current is None else f"the map was changed to {current.map_name!r}"
            self._fail(MoveFailReason.MAP_CHANGED, f"{what} during the move")
        if before is not current or changes != self._maps.changes:
            self._reports.map(self._stamp, current)
            self._report()
        return reply

    def chassis(self, request: ChassisRequest) -> Done:
        detail = self._requests.answer(request.request, self._stamp)
        match request.request:
            case SetControlMode(control_mode=mode) if mode != "auto" and self._book.current is not None:
                self._end("cancelled", text=f"the control mode was set to {mode}; moves run in auto")
        self._report()
        return Done(detail=detail)

    def _now(self) -> int:
        """Unix seconds by the messages' clock; without it nothing can be dated."""
        if self._unix_ns is None:
            raise RequestRefused(RefusalCode.UNAVAILABLE, "no clock was received: the chassis driver is not connected")
        return (self._unix_ns + self._stamp) // NANOSECONDS

    # -- ends and reports --------------------------------------------------------------------------------------------

    def _fail(self, reason: MoveFailReason, text: str, evidence: Evidence | None = None) -> None:
        if self._book.current is not None:
            self._end("failed", reason, text, evidence)

    def _end(
        self,
        state: EndState,
        reason: MoveFailReason = MoveFailReason.NONE,
        text: str = "",
        evidence: Evidence | None = None,
    ) -> None:
        last = self._status
        self._status = Status(target=last.target, intent_target=last.intent_target, passed_points=last.passed_points)
        try:
            self._motion.end()
        finally:
            move = self._book.end(state, self._now(), reason, text)
            self._reports.event(self._stamp, move.id, state, f"{reason.rest_name}: {text}" if reason else text)
            self._report()
        self._explainer.end(self._stamp, move, evidence)

    def _report(self) -> None:
        move, running, status = self._book.last, self._motion.move, self._status
        current, in_lift = self._maps.current, self._motion.is_in_lift
        self._reports.planning(planning_state(self._stamp, current, move, running, status, self._distance, in_lift))
        self._reports.path(self._stamp, self._status)
        self._reports.footprint(self._stamp, self._motion.footprint, self.parameters.values.footprint_expansion)
        self._reports.load(self._stamp, self._motion.load)
        self._reports.detected_rack(self._status.detected_rack)
        moving, stuck = self._book.current is not None, status.stuck_state != "none"
        alerts = active_alerts(
            self._state,
            self._jack,
            moving=moving,
            stuck=stuck,
            map_trouble=self._maps.trouble,
            slipped=self._motion.load.slipped,
        )
        alive = not self._driver_fault
        self._reports.status(chassis_status(self._stamp, self._modes, self._jack, alive, alerts))
