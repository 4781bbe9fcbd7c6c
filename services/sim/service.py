"""The simulator on the bus: one thread, one inbox. It takes commands and requests, steps, and publishes."""

from __future__ import annotations

import time
from collections.abc import Iterable
from typing import Any

from rackhand.bus import Bus, Publisher, Request
from rackhand.bus.log import get_logger
from rackhand.schemas import topics
from rackhand.schemas.base import Message
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.lift import LiftRequest, LiftState
from rackhand.schemas.motion import ArmCommand
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.schemas.service import DRIVER, WORLD, ServiceId
from rackhand.schemas.topics import Topic
from rackhand.schemas.world import WorldReply, WorldRequest
from rackhand.services.sim.session import CHASSIS_COMMANDER, Session
from rackhand.services.sim.simulation import Output
from rackhand.worlds.world_model import CONTROL_STEP_NS

log = get_logger(__name__)

ROBOT_TOPICS = topics.published_by("driver", "localiser", owner="chassis")
LIFT_TOPICS = topics.published_by("driver", owner="lift")
ARM_TOPICS = topics.published_by("driver", owner="arm")
WORLD_TOPICS = topics.published_by("sim")
COMMAND_DEPTH = 64
READ_AHEAD = 64  # events taken in between two steps at most, so that a flood of them does not stop time


class SimService:
    """Wires a session to the bus. ``run`` returns when the bus stops."""

    def __init__(self, bus: Bus, session: Session) -> None:
        self._bus, self._session = bus, session
        self._publishers: dict[tuple[Topic[Any], str], Publisher[Any]] = {
            (topic, WORLD): bus.publisher(topic, WORLD) for topic in WORLD_TOPICS
        }
        self._inbox = bus.inbox()
        for arm in session.simulation.arms:
            self._publishers |= {(topic, arm): bus.publisher(topic, arm) for topic in ARM_TOPICS}
            self._inbox.on(topics.ARM_COMMAND, self._command, arm, COMMAND_DEPTH)
        for lift in session.simulation.lifts:
            self._publishers |= {(topic, lift): bus.publisher(topic, lift) for topic in LIFT_TOPICS}
            self._inbox.on_request(topics.LIFT, self._serve_lift, lift)
        for robot in session.simulation.robots:
            self._publishers |= {(topic, robot): bus.publisher(topic, robot) for topic in ROBOT_TOPICS}
            self._inbox.on(topics.COMMAND, self._command, robot, COMMAND_DEPTH)
        self._inbox.on_request(topics.WORLD_CONTROL, self._serve, WORLD)
        self._inbox.on_presence(self._presence)
        self._robots = (*session.simulation.robots, *session.simulation.arms, *session.simulation.lifts)
        self._gone: set[str] = set()  # robots whose driver has the fault that it is gone
        self._advancing: Request[WorldRequest, WorldReply] | None = None
        self._faults: set[tuple[str, str]] = set()
        self._waiting_for = ""

    def run(self) -> None:
        self._publish_models()
        self._publish_things()
        self._bus.announce(*(ServiceId(DRIVER, name) for name in self._robots))
        self._publish_step()
        log.info("ready", world=self._session.simulation.world.name, seed=self._session.seed)
        while not self._bus.stopping:
            self._drain()
            self._go_on()

    def _go_on(self) -> None:
        simulation, pacer = self._session.simulation, self._session.pacer
        decision = pacer.decide(simulation.stamp, time.monotonic())
        self._finish_advance()
        match decision.kind:
            case "step":
                self._session.step()
                self._publish_all(self._session.outputs)
                if simulation.stamp % CONTROL_STEP_NS == 0:
                    self._publish_clock()
            case "republish":
                self._log_waiting()
                self._publish_step()
            case "publish_clock":
                self._publish_clock()
            case "wait":
                event = self._inbox.get(timeout=decision.seconds)
                if event is not None:
                    self._inbox.dispatch(event)

    # -- commands and requests ---------------------------------------------------------------------------------------

    def _drain(self) -> None:
        for _ in range(READ_AHEAD):
            event = self._inbox.get(timeout=0)
            if event is None:
                return
            self._inbox.dispatch(event)

    def _command(self, robot: str, command: ChassisCommand | ArmCommand) -> None:
        if not self._session.command(robot, command):
            self._log_fault(robot, command)

    def _presence(self, service: ServiceId, alive: bool) -> None:
        if not alive and self._session.gone(service):
            log.warning("participant disconnected; the simulation no longer waits for it", who=str(service))

    def _serve(self, request: Request[WorldRequest, WorldReply]) -> None:
        order = request.message.request
        try:
            reply = self._session.handle(request.message)
        except RequestRefused as refused:
            return request.refuse(refused.code, refused.text)
        if order.op not in ("inspect", "advance"):  # which come many times a second
            log.info(f"request: {order.op}", **order.model_dump(exclude={"op"}, exclude_defaults=True))
        if self._follow_drivers() and reply is not None:
            reply = self._session.reply()
        if order.op in ("reset", "pause") and self._advancing is not None:
            self._advancing.refuse(RefusalCode.PRECONDITION, f"{order.op} came before the end of the advance")
            self._advancing = None
        self._publish_changes()
        if reply is None:
            self._advancing = request
        else:
            request.reply(reply)
        return None

    def _serve_lift(self, request: Request[LiftRequest, LiftState]) -> None:
        simulation = self._session.simulation
        try:
            state = simulation.lifts[request.robot].handle(request.message, simulation.stamp)
        except RequestRefused as refused:
            return request.refuse(refused.code, refused.text)
        return request.reply(state)

    def _finish_advance(self) -> None:
        if self._advancing is not None and self._session.pacer.until is None:
            self._publish_clock()
            self._advancing.reply(self._session.reply())
            self._advancing = None

    def _follow_drivers(self) -> bool:
        """A driver that a request has made disappear or come back shows it as one on hardware would: by its liveliness
        token, and by what it publishes. False for none."""
        robots = self._session.simulation.robots
        gone = {name for name, robot in robots.items() if robot.driver_gone}
        for name in gone - self._gone:
            self._bus.withdraw(ServiceId(DRIVER, name))
            self._session.gone(ServiceId(CHASSIS_COMMANDER, name))
        before, self._gone = self._gone, gone
        for name in before - gone:
            self._publish(topics.CHASSIS_MODEL, name, robots[name].chassis_model())
            self._bus.announce_part(ServiceId(DRIVER, name))
        return before != gone

    # -- publications ------------------------------------------------------------------------------------------------

    def _publish(self, topic: Topic[Any], robot: str, message: Message) -> None:
        self._publishers[topic, robot].put(message)

    def _publish_step(self) -> None:
        self._publish_all(self._session.simulation.outputs)
        self._publish_clock()

    def _publish_all(self, outputs: Iterable[Output]) -> None:
        for output in outputs:
            if output.robot not in self._gone:
                self._publish(output.topic, output.robot, output.message)

    def _publish_clock(self) -> None:
        self._publish(topics.CLOCK, WORLD, self._session.clock)

    def _publish_models(self) -> None:
        for name, robot in self._session.simulation.robots.items():
            self._publish(topics.CHASSIS_MODEL, name, robot.chassis_model())
        for name, lift in self._session.simulation.lifts.items():
            self._publish(topics.LIFT_MODEL, name, lift.model())
        for name in self._session.simulation.arms:
            self._publish(topics.ARM_MODEL, name, self._session.simulation.arm_model(name))

    def _publish_things(self) -> None:
        self._publish(topics.SCENE, WORLD, self._session.simulation.scene())
        self._publish(topics.OBJECTS, WORLD, self._session.simulation.objects())

    def _publish_changes(self) -> None:
        changes = self._session.take_changes()
        if changes.clock:  # before the measurements: a reader of the first of a new run must know that it is one
            self._publish_clock()
        if changes.things:
            self._publish_things()
        if changes.outputs:
            self._publish_step()

    def _log_fault(self, robot: str, command: ChassisCommand | ArmCommand) -> None:
        """A command that is wrong in itself is logged once; late ones are no fault."""
        fault = self._session.simulation.arms[robot].fault_of(command) if isinstance(command, ArmCommand) else ""
        if fault and (robot, fault) not in self._faults:
            self._faults.add((robot, fault))
            log.warning("command ignored; further ones with this fault are not logged", robot=robot, fault=fault)

    def _log_waiting(self) -> None:
        pacer, stamp = self._session.pacer, self._session.simulation.stamp
        missing = ", ".join(str(service) for service in pacer.missing(stamp) or pacer.unanswered(stamp))
        if missing != self._waiting_for:
            text = "waiting for commands" if missing else "no longer waiting for commands"
            log.info(text, **({"missing": missing} if missing else {}), stamp=stamp)
            self._waiting_for = missing
