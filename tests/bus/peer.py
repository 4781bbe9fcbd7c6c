"""The other process of the bus tests: ``python -m tests.bus.peer ENDPOINT ROLE``."""

from __future__ import annotations

import sys

from rackhand.bus import Bus, BusConfig, Request, Sample
from rackhand.schemas import topics
from rackhand.schemas.base import Twist2
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.moves import MoveReply, PlanningState
from rackhand.schemas.refusal import RefusalCode
from rackhand.schemas.service import ServiceId

ME = ServiceId("planner", "amr1")


def serve(bus: Bus) -> None:
    """Latch a state, echo odometry as commands, answer ``list``, refuse ``get``, never answer ``cancel``."""
    bus.publisher(topics.PLANNING_STATE, "amr1").put(PlanningState(stamp=7, action_id=3))
    command = bus.publisher(topics.COMMAND, "amr1")
    inbox = bus.inbox().subscribe(topics.ODOMETRY, "amr1").serve(topics.MOVES, "amr1")
    held = []
    bus.announce()
    for event in inbox:
        if isinstance(event, Sample):
            command.put(ChassisCommand(answers=event.message.stamp, twist=Twist2(linear=0.0, angular=0.0)))
        elif isinstance(event, Request):
            match event.message.request.op:
                case "list":
                    event.reply(MoveReply(moves=()))
                case "get":
                    event.refuse(RefusalCode.NOT_FOUND, "no such move")
                case "create":
                    del event  # forgets to answer
                case _:
                    held.append(event)


def fail(bus: Bus) -> None:
    """End by an uncaught exception, with subscriptions and queryables open."""
    bus.inbox().subscribe(topics.ODOMETRY).serve(topics.MOVES, "amr1")
    bus.announce()
    raise RuntimeError("on purpose")


if __name__ == "__main__":
    with Bus(ME, BusConfig(connect=sys.argv[1])) as bus:
        bus.handle_signals()
        {"serve": serve, "fail": fail}[sys.argv[2]](bus)
