"""What a test does to a world and asks of it, in terms of two primitives: a request, and the poses of things."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import TypeVar

from rackhand.schemas.base import NANOSECONDS, Message, Pose2
from rackhand.schemas.world import (
    Advance,
    Contact,
    InjectFault,
    Inspect,
    MoveObject,
    MoveRobot,
    ObjectPose,
    Pause,
    Place,
    Push,
    Remove,
    Reset,
    Restore,
    WorldReply,
)
from rackhand.testing.poses import planar

POLL = 0.05  # s of wall time between two looks at a running world
ADVANCE_TIMEOUT = 240.0  # s of wall time; only ever bounds a failure

T = TypeVar("T")
Pose = Sequence[float]


class NotWithin(AssertionError):
    """What a test waited for did not come within the simulation time it gave."""


class WorldControl(ABC):
    """Time, obstacles, faults and ground truth of a simulated world.

    Poses are ``(x, y, yaw)`` in the map frame, in metres and radians; times are seconds of simulation time. A request
    that the world cannot carry out raises ``rackhand.bus.Refused``, whose text says why, and changes nothing.
    """

    @abstractmethod
    def ask(self, request: Message, timeout: float = 60.0) -> WorldReply:
        """Send one of the requests of ``rackhand.schemas.world``; ``timeout`` in wall seconds."""

    @abstractmethod
    def objects(self) -> dict[str, ObjectPose]:
        """Ground truth: the pose of everything that can move, by name."""

    # -- time --------------------------------------------------------------------------------------------------------

    def pause(self) -> WorldReply:
        """Stop simulation time; it then passes in ``advance`` and ``until`` only."""
        return self.ask(Pause(paused=True))

    def resume(self) -> WorldReply:
        """Let simulation time run on by itself."""
        return self.ask(Pause(paused=False))

    def advance(self, seconds: float) -> WorldReply:
        """Let so much simulation time pass, then stand still: pauses a running world first."""
        if not self.inspect().clock.paused:
            self.pause()
        return self.ask(Advance(duration_ns=round(seconds * NANOSECONDS)), timeout=ADVANCE_TIMEOUT)

    def until(self, found: Callable[[], T | None], what: str, within: float = 120.0, step: float = 0.1) -> T:
        """Wait until ``found()`` is not None and return that; at most ``within`` seconds of simulation time.

        A paused world is advanced by ``step`` seconds between two looks, so that the same run is seen every time; a
        running one is left to run. Raises ``NotWithin``, whose text names ``what``.
        """
        begun: int | None = None
        while (value := found()) is None:
            clock = self.inspect().clock
            begun = clock.stamp if begun is None else begun
            if clock.stamp - begun > within * NANOSECONDS:
                raise NotWithin(f"{within:g} s of simulation time passed before this: {what}")
            if clock.paused:
                self.advance(step)
            else:
                time.sleep(POLL)
        return value

    def reset(self, seed: int | None = None) -> WorldReply:
        """Begin a new run of the world at time 0: things where its file has them, no obstacles, no faults."""
        return self.ask(Reset(seed=seed))

    def now(self) -> float:
        """Simulation time in seconds."""
        return self.inspect().clock.stamp / NANOSECONDS

    # -- things ------------------------------------------------------------------------------------------------------

    def place(self, name: str, at: Pose, size: Sequence[float] = (0.4, 0.4, 0.4), kind: str = "box") -> WorldReply:
        """Put an obstacle into the world, or move the one of that name.

        ``size`` (m): length, width, height of a ``box``; radius, height of a ``cylinder`` or ``person``.
        """
        return self.ask(Place.model_validate({"name": name, "kind": kind, "pose": _pose(at), "size": tuple(size)}))

    def remove(self, name: str) -> WorldReply:
        """Take an obstacle, a rack or an item out of the world."""
        return self.ask(Remove(name=name))

    def restore(self, name: str) -> WorldReply:
        """Bring a removed rack or item back to where it was."""
        return self.ask(Restore(name=name))

    def move(self, name: str, to: Pose, lies_on: str | None = None, level: int | None = None) -> WorldReply:
        """Set a robot, a rack or an item down elsewhere, at rest.

        An item goes to the floor, on top of the box ``lies_on``, or on a board of the rack of that name: ``level``
        counts from 0, the lowest; None is the top.
        """
        if name in self._robots():
            return self.ask(MoveRobot(robot=name, pose=_pose(to)))
        return self.ask(MoveObject(name=name, pose=_pose(to), lies_on=lies_on, level=level))

    def push(self, name: str, shift: Pose) -> WorldReply:
        """Shift a rack or an item at once, by ``shift`` in its own frame; a carried rack slides on the jack."""
        return self.ask(Push(name=name, shift=_pose(shift)))

    # -- faults ------------------------------------------------------------------------------------------------------

    def fault(self, name: str, target: str, part: int | None = None) -> WorldReply:
        """Cause a fault of ``rackhand.schemas.faults.FAULTS``, as ``fault("lidar_dead", "amr1")``."""
        return self.ask(InjectFault(target=target, fault=name, part=part))

    def clear(self, name: str, target: str, part: int | None = None) -> WorldReply:
        """End a fault."""
        return self.ask(InjectFault(target=target, fault=name, part=part, active=False))

    # -- ground truth ------------------------------------------------------------------------------------------------

    def inspect(self) -> WorldReply:
        """Clock, seed, digest of the run so far, contacts, participants."""
        return self.ask(Inspect())

    def true_poses(self) -> dict[str, Pose2]:
        """Where everything that can move really is."""
        return {name: planar(thing) for name, thing in self.objects().items()}

    def true_pose(self, name: str) -> Pose2:
        """Where one robot, rack or thing really is."""
        poses = self.true_poses()
        if name not in poses:
            raise KeyError(f"nothing that moves is named {name!r}; known: {sorted(poses)}")
        return poses[name]

    def contacts(self) -> tuple[Contact, ...]:
        """What robots touched since the run began, except floor and load: when, who, what, and how hard (N)."""
        return self.inspect().contacts

    def _robots(self) -> set[str]:
        return set(self.inspect().command_stamps)


def _pose(pose: Pose) -> Pose2:
    x, y, yaw = (*pose, 0.0)[:3]
    return Pose2(x=x, y=y, yaw=yaw)
