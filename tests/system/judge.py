"""The judge of system tests observes the ground truth: it asks the simulator, never the planner, what happened."""

from __future__ import annotations

import math
from types import TracebackType
from typing import Any

from rackhand.bus import Bus, BusConfig, Sample, Unavailable
from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS, Message, Pose2
from rackhand.schemas.service import CELL, ServiceId
from rackhand.schemas.world import Advance, Inspect, ObjectPose, Pause, WorldReply, WorldRequest


class Judge:
    """A client of the world's control and of its truth."""

    def __init__(self, endpoint: str) -> None:
        self._bus = Bus(ServiceId("judge", CELL), BusConfig(connect=endpoint))

    def __enter__(self) -> Judge:
        self._bus.__enter__()
        self._truth = self._bus.inbox().subscribe(topics.OBJECTS, depth=1)
        presence = self._bus.inbox().watch_services()
        while (event := presence.get(timeout=60)) is not None and str(getattr(event, "service", "")) != "world/sim":
            pass
        assert event is not None, "no simulator came"
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bus.__exit__(kind, error, trace)

    def ask(self, request: Message, timeout: float = 60.0) -> WorldReply:
        """One of the requests of ``rackhand.schemas.world``."""
        return self._bus.call(topics.WORLD_CONTROL, WorldRequest(request=request), timeout=timeout)

    def inspect(self) -> WorldReply:
        return self.ask(Inspect())

    def pause(self) -> WorldReply:
        return self.ask(Pause(paused=True))

    def resume(self) -> WorldReply:
        return self.ask(Pause(paused=False))

    def advance(self, seconds: float) -> WorldReply:
        """Let a paused world run on by so much simulation time."""
        return self.ask(Advance(duration_ns=round(seconds * NANOSECONDS)), timeout=240.0)

    def now(self) -> float:
        """Simulation time in seconds."""
        return self.inspect().clock.stamp / NANOSECONDS

    def stopped_after(self, silent: str, speed: float = 0.02) -> float:
        """Seconds of simulation time from a dead planner's last command until its robot truly stands.

        ``speed`` (m/s) is what counts as standing.
        """
        trail: list[tuple[int, Pose2]] = []
        while True:
            event = self._truth.get(timeout=20)
            assert isinstance(event, Sample), "the simulator publishes no ground-truth poses"
            pose = next(planar(thing) for thing in event.message.objects if thing.name == silent)
            trail.append((event.message.stamp, pose))
            if len(trail) > 1:
                (before, there), (now, here) = trail[-2:]
                if math.hypot(here.x - there.x, here.y - there.y) < speed * (now - before) / NANOSECONDS:
                    return (before - self.inspect().command_stamps[silent]) / NANOSECONDS

    def objects(self) -> dict[str, ObjectPose]:
        """Where everything that can move really is, as of the newest publication of the truth not asked for before."""
        event = self._truth.get(timeout=20)
        if event is None:
            raise Unavailable("the simulator publishes no ground-truth poses")
        assert isinstance(event, Sample)
        return {thing.name: thing for thing in event.message.objects}

    def true_poses(self) -> dict[str, Pose2]:
        return {name: planar(thing) for name, thing in self.objects().items()}

    def true_pose(self, name: str) -> Pose2:
        return self.true_poses()[name]


def planar(thing: ObjectPose) -> Pose2:
    """Position and heading of a thing, in the map."""
    w, x, y, z = thing.orientation
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return Pose2(x=thing.position[0], y=thing.position[1], yaw=yaw)


def distance(pose: Pose2, x: float, y: float) -> float:
    return math.hypot(pose.x - x, pose.y - y)


def turn(a: float, b: float) -> float:
    """The angle between two headings, in radians, 0 … π."""
    return abs(math.remainder(a - b, math.tau))


def standard(x: float | None = None, y: float | None = None, ori: float | None = None, **more: Any) -> dict[str, Any]:
    """The body of a standard move."""
    target = {"target_x": x, "target_y": y, "target_ori": ori}
    return {"creator": "test", "type": "standard"} | {k: v for k, v in target.items() if v is not None} | more
