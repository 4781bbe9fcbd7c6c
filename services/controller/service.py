"""The controller on the bus: one thread, one inbox. Requests are answered as they come, commands go out with states."""

from __future__ import annotations

from rackhand.bus import Bus, Event, Inbox, Presence, Refused, Request, Sample, Unavailable
from rackhand.bus.errors import CallTimeout
from rackhand.bus.log import get_logger
from rackhand.runtime.driver_link import DriverLink
from rackhand.schemas import topics
from rackhand.schemas.motion import ArmCommand, ArmState, CrfAnswer, MotionStream
from rackhand.schemas.refusal import RefusalCode
from rackhand.schemas.service import WORLD, ServiceId
from rackhand.schemas.world import Join, WorldRequest
from rackhand.services.controller.access.audit_writer import AuditWriter
from rackhand.services.controller.controller import Controller

log = get_logger(__name__)

SIMULATOR = ServiceId("sim", WORLD)
READ_AHEAD = 64  # events taken in before a tick, so that it answers the newest state and yet is not put off for ever
PLAN_POLL = 0.01  # seconds between looks for a plan while nothing else happens


class ControllerService:
    """Wires one arm to the bus. ``run`` returns when the bus stops."""

    def __init__(self, bus: Bus, robot: str, joints: int, controller: Controller, audit: AuditWriter) -> None:
        self._bus, self._robot, self._joints = bus, robot, joints
        self._controller, self._audit = controller, audit
        self._link = DriverLink("the arm's driver", controller.period_ns)
        self._state: ArmState | None = None
        self._answer: ArmCommand | None = None
        self._last_error = ""
        self._command = bus.publisher(topics.ARM_COMMAND, robot)
        self._status = bus.publisher(topics.MOTION_STATUS, robot)
        self._events = bus.publisher(topics.MOTION_EVENT, robot)
        self._streams = bus.publisher(topics.MOTION_STREAM, robot)
        self._diagnostics = bus.publisher(topics.MOTION_DIAGNOSTICS, robot)
        self._path = bus.publisher(topics.MOTION_PATH, robot)
        self._inbox = self._subscribe()

    def _subscribe(self) -> Inbox:
        inbox = self._bus.inbox()
        inbox.subscribe(topics.ARM_STATE, self._robot)
        inbox.subscribe(topics.MOTION_SESSION, self._robot)
        inbox.subscribe(topics.CLOCK, WORLD)
        inbox.serve(topics.MOTION, self._robot, low_priority=True)
        inbox.serve(topics.MOTION_STOP, self._robot)
        inbox.watch_services()
        return inbox

    def run(self) -> None:
        self._bus.announce()
        log.info("ready", robot=self._robot, epoch=self._controller.access.epoch)
        while (event := self._next()) is not None or self._controller.busy:
            for _ in range(READ_AHEAD):
                if event is None:
                    break
                self._take(event)
                event = self._inbox.get(0)
            if event is not None:
                self._take(event)
            self._tick_if_due()
            self._controller.poll()
            self._publish()
            self._join_if_needed()

    def _next(self) -> Event | None:
        """The next event; None when the bus stops, or for a look at the plan while a paused world says nothing."""
        if not self._controller.busy:
            return self._inbox.get()
        event = self._inbox.get(PLAN_POLL)
        if event is None:
            self._controller.await_plan(PLAN_POLL)
        return event

    def _take(self, event: Event) -> None:
        if self._link.lockstep or (isinstance(event, Request) and event.query is topics.MOTION):
            self._tick_if_due()  # in lockstep each step is answered; else the inbox has nothing more urgent
        self.handle(event)

    def handle(self, event: Event) -> None:
        """Take in one event. What goes wrong here ends neither the service nor another request."""
        try:
            match event:
                case Sample(topic=topics.ARM_STATE, message=state):
                    self._on_message(state)
                case Sample(topic=topics.CLOCK, message=clock):
                    self._void_if(self._link.clock(clock))
                case Sample(topic=topics.MOTION_SESSION, message=gone):
                    self._controller.disconnected(gone.session)
                case Request(query=topics.MOTION, message=call):
                    self._controller.request(call.session, call.text, event)
                case Request(query=topics.MOTION_STOP, message=call):
                    self._controller.stop_request(call.session, call.text, event)
                case Presence(service=service, alive=alive) if service == SIMULATOR:
                    self._void_if(self._link.presence(alive))
                case _:
                    pass
        except Exception as error:
            self._log_once(error)
            if isinstance(event, Request):
                event.refuse(RefusalCode.INTERNAL, "the controller failed to answer; its log says more")
        self._publish()

    # -- the loop -----------------------------------------------------------------------------------------------------

    def _on_message(self, state: ArmState) -> None:
        if len(state.q) != self._joints:
            self._log_once(ValueError(f"the driver has {len(state.q)} joints, the arm {self._joints}"))
            return
        self._void_if(self._link.sample(topics.ARM_STATE.name, state.stamp))
        self._state = state

    def _void_if(self, why: str | None) -> None:
        if why is not None:
            log.warning(why, robot=self._robot)
            self._state = self._answer = None
            self._controller.reset(why)

    def _tick_if_due(self) -> None:
        state, self._state = self._state, None
        if state is None:
            return
        asked = self._link.asks(state.stamp)
        if asked == "tick":
            self._answer = self._tick(state)
        if asked != "skip" and self._answer is not None:
            self._command.put(self._answer)

    def _tick(self, state: ArmState) -> ArmCommand | None:
        """Nothing is commanded when a tick fails: a driver that hears nothing stops the arm."""
        try:
            return self._controller.tick(state, self._link.lockstep)
        except Exception as error:
            self._log_once(error)
            self._controller.reset(f"the controller failed: {type(error).__name__}: {error}")
            return None

    # -- what is told -------------------------------------------------------------------------------------------------

    def _publish(self) -> None:
        output = self._controller.take()
        for event in output.events:
            log.info(event.name, to=event.to, by=event.info.by, reason=event.info.reason, kind=event.info.kind)
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

    def _log_once(self, error: Exception) -> None:
        """With its traceback; an error that comes back at every tick is written once."""
        text = f"{type(error).__name__}: {error}"
        if text != self._last_error:
            log.error(text, exc_info=error)
        self._last_error = text

    def _join_if_needed(self) -> None:
        """Ask the simulator to wait for this controller's commands. A real robot is not asked."""
        if not self._link.needs_join:
            return
        join = Join(robot=self._robot, service="controller", period_ns=self._controller.period_ns)
        try:
            self._bus.call(topics.WORLD_CONTROL, WorldRequest(request=join), timeout=2.0)
        except Refused as refused:
            log.error("the simulator refused the controller", code=refused.code, text=refused.text)
        except (Unavailable, CallTimeout) as error:
            self._log_once(error)
            return  # it is announced and does not answer yet: its next message is the occasion to ask again
        self._link.needs_join = False
