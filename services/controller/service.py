"""The controller on the bus: its control loop runs the core of one arm. Commands go out with the arm's states."""

from __future__ import annotations

from rackhand.bus import Bus, Request
from rackhand.bus.log import get_logger
from rackhand.runtime.control_loop import ControlLoop, LoopSettings
from rackhand.schemas import topics
from rackhand.schemas.motion import ArmCommand, ArmState, CrfAnswer, CrfCall, MotionEvent, MotionStream, SessionGone
from rackhand.schemas.service import ServiceId
from rackhand.schemas.world import Clock
from rackhand.services.controller.access.audit_writer import AuditWriter
from rackhand.services.controller.controller import Controller

log = get_logger(__name__)

_EVENT_TEXTS = {"controlGranted": "control granted", "controlLost": "control lost", "heartbeatLost": "heartbeat lost"}


class ControllerService:
    """Gives the control loop the core of one arm. ``run`` returns when the bus stops."""

    ready = True

    def __init__(self, bus: Bus, robot: str, joints: int, controller: Controller, audit: AuditWriter) -> None:
        self._joints, self._controller, self._audit = joints, controller, audit
        self._state: ArmState | None = None
        self._status = bus.publisher(topics.MOTION_STATUS, robot)
        self._events = bus.publisher(topics.MOTION_EVENT, robot)
        self._streams = bus.publisher(topics.MOTION_STREAM, robot)
        self._diagnostics = bus.publisher(topics.MOTION_DIAGNOSTICS, robot)
        self._path = bus.publisher(topics.MOTION_PATH, robot)
        settings = LoopSettings(ServiceId("controller", robot), "the arm driver", controller.period_ns)
        self._loop = ControlLoop(bus, self, topics.ARM_COMMAND, settings)
        self._loop.measure(topics.ARM_STATE, self._take_state, triggers=True)
        self._loop.on(topics.MOTION_SESSION, self._disconnected)
        self._loop.on_request(topics.MOTION, self._request, low_priority=True)
        self._loop.on_request(topics.MOTION_STOP, self._stop_request, at_once=True)
        self.run = self._loop.run

    def _take_state(self, state: ArmState) -> None:
        """Raises ``ValueError`` for a state of another arm, which is then not answered."""
        if len(state.q) != self._joints:
            raise ValueError(f"the driver reports {len(state.q)} joints, the arm has {self._joints}")
        self._state = state
        self._controller.measured(state)

    def _disconnected(self, gone: SessionGone) -> None:
        self._controller.disconnected(gone.session)

    def _request(self, request: Request[CrfCall, CrfAnswer]) -> None:
        self._controller.request(request.message.session, request.message.text, request)

    def _stop_request(self, request: Request[CrfCall, CrfAnswer]) -> None:
        self._controller.stop_request(request.message.session, request.message.text, request)

    # -- the loop's core ---------------------------------------------------------------------------------------------

    @property
    def busy(self) -> bool:
        return self._controller.busy

    def on_clock(self, clock: Clock) -> None: ...

    def tick(self, lockstep: bool) -> ArmCommand | None:
        return None if self._state is None else self._controller.tick(self._state, lockstep)

    def tick_failed(self, error: Exception) -> None:
        """Nothing is commanded: a driver that receives no commands stops the arm."""
        self._controller.reset(f"the controller failed: {type(error).__name__}: {error}")

    def reset(self, why: str) -> None:
        self._state = None
        self._controller.reset(why)

    def set_driver_fault(self, fault: str) -> None: ...

    def poll(self) -> None:
        self._controller.poll()

    def wait(self, seconds: float) -> None:
        self._controller.await_plan(seconds)

    def publish(self) -> None:
        output = self._controller.take()
        for event in output.events:
            _log_event(event)
            self._events.put(event)
        self._audit.put(output.audit)
        for ticket, text in output.replies:
            assert isinstance(ticket, Request)
            ticket.reply(CrfAnswer(text=text))
        for session, text in output.streams:
            self._streams.put(MotionStream(session=session, text=text))
        if output.status is not None:
            self._status.put(output.status)
        if output.diagnostics is not None:
            self._diagnostics.put(output.diagnostics)
        if output.path is not None:
            self._path.put(output.path)
        for error in output.errors:
            log.error("a request failed", exc_info=error)


def _log_event(event: MotionEvent) -> None:
    fields = event.info.model_dump(
        include={"client", "priority", "by", "reason", "kind", "joint", "value", "bound", "unit", "stopped"}
    )
    log.info(_EVENT_TEXTS.get(event.name, event.name), **{name: value for name, value in fields.items() if value})
