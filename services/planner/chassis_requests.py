"""Requests to the chassis beside its moves: control mode, emergency stop, jack, remote driving, a target to follow."""

from __future__ import annotations

from rackhand.schemas.chassis import (
    ClearJackErrors,
    DetectRacks,
    FollowTarget,
    JackRequest,
    JackSelfCheck,
    RemoteTwist,
    SetControlMode,
    SetEmergencyStop,
    SetPose,
)
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.jacking import JackOrders
from rackhand.services.planner.modes import Modes
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.moves.book import MoveBook
from rackhand.services.planner.perception.chassis_state import ChassisState, Followed
from rackhand.services.planner.rack_reports import RackReports

Request = (
    SetControlMode
    | SetEmergencyStop
    | RemoteTwist
    | FollowTarget
    | JackRequest
    | JackSelfCheck
    | ClearJackErrors
    | DetectRacks
    | SetPose
)


class ChassisRequests:
    """Each is refused with a reason, or done; what moves, moves at the next tick."""

    def __init__(
        self, book: MoveBook, motion: Motion, modes: Modes, jack: JackOrders, state: ChassisState, racks: RackReports
    ) -> None:
        self._book, self._motion, self._modes = book, motion, modes
        self._jack, self._state, self._racks = jack, state, racks

    def answer(self, request: Request, stamp: int) -> str:
        """A remark for the client, or an empty text. ``stamp``: of the last measurement. Raises ``RequestRefused``."""
        match request:
            case SetControlMode(control_mode=mode):
                self._modes.set_control_mode(mode)
            case SetEmergencyStop(enable=enable):
                self._modes.stop(requested=enable)
                if not enable and self._modes.stop_pressed:
                    return "the emergency-stop button is still pressed"
            case RemoteTwist(twist=twist):
                if self._state.power_cable:
                    raise RequestRefused(RefusalCode.PRECONDITION, "a power cable is plugged into the chassis")
                self._modes.take_remote_twist(twist, stamp)
            case FollowTarget() as target:
                if self._book.current is None or self._book.current.type != "follow_target":
                    raise RequestRefused(RefusalCode.PRECONDITION, "no follow_target move is running")
                self._state.followed = Followed(stamp, target)
            case JackRequest(direction=direction):
                self._check_may_jack()
                return self._jack.request(direction, self._state.jack)
            case JackSelfCheck():
                self._check_may_jack()
                self._motion.load.check_nothing_above()
                return self._jack.check(self._state.jack)
            case ClearJackErrors():
                return self._jack.clear()
            case DetectRacks(enable=enable):
                self._racks.searching = enable
            case SetPose():
                return self._set_pose()
        return ""

    def _check_may_jack(self) -> None:
        if self._book.current is not None:
            raise RequestRefused(
                RefusalCode.PRECONDITION,
                f"move {self._book.current.id} is running; the jack moves only while no move runs",
            )
        if self._modes.emergency_stop:
            raise RequestRefused(RefusalCode.PRECONDITION, "the emergency stop is on")

    def _set_pose(self) -> str:
        """Clients give a first guess after they set a map. The localiser of this version finds the pose by itself."""
        if (trouble := self._state.pose_trouble()) is not None:
            raise RequestRefused(RefusalCode.UNAVAILABLE, f"there is no localiser to set the pose of: {trouble}")
        return "not needed: the localiser knows the pose"
