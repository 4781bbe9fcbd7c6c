"""Taking part in a simulator's lockstep. A real robot has no simulator, and nothing of this happens."""

from __future__ import annotations

from rackhand.bus import Bus, CallTimeout, Refused, Unavailable
from rackhand.bus.log import get_logger
from rackhand.schemas import topics
from rackhand.schemas.service import DRIVER, WORLD, ServiceId
from rackhand.schemas.world import Join, WorldRequest

log = get_logger(__name__)

SIMULATOR = ServiceId("sim", WORLD)


class LockstepParticipant:
    """Asks a simulator, once in each of its runs, to wait for the commands of ``service``, one each ``period_ns``."""

    def __init__(self, bus: Bus, service: ServiceId, period_ns: int) -> None:
        self._bus = bus
        self._join = Join(robot=service.robot, service=service.service, period_ns=period_ns)
        self._simulated = False
        self._run: str | None = None
        self._due = False
        self._driver_left = False

    def presence(self, service: ServiceId, alive: bool) -> None:
        """Also of the robot's driver: who has lost it does not take part, and joins again when it is back."""
        if service == ServiceId(DRIVER, self._join.robot):
            self._due = self._due or (alive and self._driver_left and self._simulated)
            self._driver_left = not alive
        if service == SIMULATOR:
            self._simulated = self._due = alive
            if not alive:
                self._run = None

    def clock(self, run: str) -> None:
        """The clock of a run was received: participants of a former run have to join again."""
        if self._run not in (None, run):
            self._due = self._simulated
        self._run = run

    def join_if_due(self) -> None:
        if not self._due:
            return
        try:
            self._bus.call(topics.WORLD_CONTROL, WorldRequest(request=self._join), timeout=2.0)
        except Refused as refused:
            log.error(
                "the simulator refused the lockstep request of this service", code=refused.code, text=refused.text
            )
        except (Unavailable, CallTimeout) as error:
            log.info("no answer from the simulator yet; retrying", error=str(error))
            return
        self._due = False
