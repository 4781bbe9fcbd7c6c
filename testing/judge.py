"""The judge of a test observes the ground truth: it asks the simulator, never the planner, what happened."""

from __future__ import annotations

import math
import time
from types import TracebackType

from rackhand.bus import Bus, BusConfig, Refused, Sample, Unavailable
from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Message, Pose2
from rackhand.schemas.service import CELL, ServiceId
from rackhand.schemas.world import (
    MoveObject,
    MoveRobot,
    ObjectPose,
    Objects,
    Place,
    Push,
    Remove,
    Reset,
    Restore,
    WorldReply,
    WorldRequest,
)
from rackhand.services.launch.processes import PATIENT_LEASE
from rackhand.testing.poses import planar
from rackhand.testing.world import WorldControl

PATIENCE = 20.0  # s of wall time; only ever bounds a failure
AGAIN = 1.0  # s of wall time without things, after which a paused world is asked for them
PERIOD_NS = round(NANOSECONDS / topics.OBJECTS.rate)  # of ground-truth poses


class Judge(WorldControl):
    """A client of a world's control and of its ground truth, on the bus at ``endpoint`` (as ``tcp/127.0.0.1:7447``)."""

    def __init__(self, endpoint: str) -> None:
        self._bus = Bus(ServiceId("judge", CELL), BusConfig(connect=endpoint, lease=PATIENT_LEASE))
        self._newest: Objects | None = None

    def __enter__(self) -> Judge:
        self._bus.__enter__()
        self._truth = self._bus.inbox().subscribe(topics.OBJECTS, depth=1)
        presence = self._bus.inbox().watch_services()
        while (event := presence.get(timeout=60)) is not None and str(getattr(event, "service", "")) != "world/sim":
            pass
        assert event is not None, "no simulator joined the bus within 60 s"
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bus.__exit__(kind, error, trace)

    def ask(self, request: Message, timeout: float = 60.0) -> WorldReply:
        self._take()
        newest = self._newest
        if isinstance(request, Reset | Place | Remove | Restore | MoveRobot | MoveObject | Push):
            self._newest = None  # a paused world publishes its things again after these
        try:
            order = WorldRequest(request=request)  # type: ignore[arg-type]
            return self._bus.call_when_served(topics.WORLD_CONTROL, order, timeout=timeout)
        except Refused:
            self._newest = newest
            raise

    def objects(self) -> dict[str, ObjectPose]:
        """Ground truth: of a paused world as it stands, of a running one its next publication."""
        clock = self.inspect().clock
        if not clock.paused:
            self._newest = None
        deadline = time.monotonic() + PATIENCE
        while self._newest is None or (clock.paused and not 0 <= clock.stamp - self._newest.stamp < PERIOD_NS):
            self._take(timeout=AGAIN)
            if self._newest is None and clock.paused:
                self.pause()  # a paused world publishes its things again; what it published before was not received
            if time.monotonic() > deadline:
                raise Unavailable("the simulator publishes no ground-truth poses")
        return {thing.name: thing for thing in self._newest.objects}

    def _take(self, timeout: float = 0.0) -> None:
        event = self._truth.get(timeout=timeout)
        if isinstance(event, Sample):
            self._newest = event.message

    def stopped_after(self, silent: str, speed: float = 0.02) -> float:
        """Seconds of simulation time from a dead planner's last command until its robot truly stands.

        ``speed`` (m/s) is what counts as standing.
        """
        trail: list[tuple[int, Pose2]] = []
        while True:
            event = self._truth.get(timeout=PATIENCE)
            assert isinstance(event, Sample), "the simulator publishes no ground-truth poses"
            pose = next(planar(thing) for thing in event.message.objects if thing.name == silent)
            trail.append((event.message.stamp, pose))
            if len(trail) > 1:
                (before, there), (now, here) = trail[-2:]
                if math.hypot(here.x - there.x, here.y - there.y) < speed * (now - before) / NANOSECONDS:
                    return (before - self.inspect().command_stamps[silent]) / NANOSECONDS
