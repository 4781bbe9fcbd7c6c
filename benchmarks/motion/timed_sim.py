"""``python -m benchmarks.motion.timed_sim RECORD [options of rackhand.services.sim]``: the simulator, which also notes
when it publishes an arm state and when it has read the command that answers it, and leaves both in RECORD when it ends.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

from rackhand.schemas.base import Message
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.motion import ArmCommand, ArmState
from rackhand.schemas.topics import Topic
from rackhand.services.sim import __main__ as program
from rackhand.services.sim.service import SimService

told: dict[int, float] = {}
answered: dict[int, float] = {}


class TimedSim(SimService):
    """Notes the first telling of each state and the first command that answers it."""

    def _publish(self, topic: Topic[Any], robot: str, message: Message) -> None:
        if isinstance(message, ArmState):
            told.setdefault(message.stamp, time.perf_counter())
        super()._publish(topic, robot, message)

    def _command(self, robot: str, command: ChassisCommand | ArmCommand) -> None:
        if isinstance(command, ArmCommand):
            answered.setdefault(command.answers, time.perf_counter())
        super()._command(robot, command)


if __name__ == "__main__":
    record = Path(sys.argv.pop(1))
    program.SimService = TimedSim  # type: ignore[misc]
    try:
        program.app(prog_name="python -m rackhand.services.sim")
    finally:
        record.write_text(json.dumps({"told": list(told.items()), "answered": list(answered.items())}))
