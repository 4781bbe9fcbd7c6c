"""What only a simulator has: the clock it drives, control of it, and ground truth."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from rackhand.schemas.base import Array, Message, Pose2, Quaternion, Stamp, Vec3
from rackhand.schemas.faults import FaultName


class Clock(Message):
    """Simulation time. ``run`` changes at every start and reset, when time starts again at 0.

    ``speed`` is the wanted ratio to wall time, ``None`` for as fast as possible; ``unix_ns`` is the unix
    time of stamp 0.
    """

    stamp: Stamp
    run: str
    step_ns: int
    speed: float | None
    paused: bool
    lockstep: bool
    unix_ns: int


class Join(Message):
    """A participant declares itself: the driver waits for its commands, one each ``period_ns`` of stamps.

    In lockstep the answer to the state of stamp t takes effect at t + ``latency`` × ``period_ns`` exactly, and the
    simulation waits there until the answer has arrived; until then it goes on. Running free it lets no participant fall
    behind further than the freshness of commands allows. The declaration ends with the participant's liveliness token,
    or with ``Leave``.
    """

    op: Literal["join"] = "join"
    robot: str
    service: str
    period_ns: Annotated[int, Field(gt=0)]
    latency: Annotated[int, Field(ge=0, description="command latency in periods, for lockstep")] = 1


class Leave(Message):
    op: Literal["leave"] = "leave"
    robot: str
    service: str


class Pause(Message):
    op: Literal["pause"] = "pause"
    paused: bool


class Advance(Message):
    """Run a paused simulation for this long, then pause again. Answered when it has arrived there."""

    op: Literal["advance"] = "advance"
    duration_ns: Annotated[int, Field(gt=0)]


class SetSpeed(Message):
    op: Literal["speed"] = "speed"
    speed: Annotated[float, Field(gt=0, le=1000)] | None = Field(description="None: as fast as possible")


class Reset(Message):
    """Start a new run at time 0 with this seed (the present one if none is given)."""

    op: Literal["reset"] = "reset"
    seed: Annotated[int, Field(ge=0)] | None = None


class Place(Message):
    """Put an obstacle into the world, or move the one of that name. Sizes in metres: box l×w×h, cylinder r×h."""

    op: Literal["place"] = "place"
    name: str
    kind: Literal["box", "cylinder", "person"] = "box"
    pose: Pose2
    size: Annotated[tuple[float, ...], Field(strict=False, min_length=2, max_length=3)] = (0.4, 0.4, 0.4)
    walk: tuple[Pose2, ...] = Field(default=(), strict=False, description="waypoints it walks in a loop")
    speed: Annotated[float, Field(ge=0)] = 0.0


class Remove(Message):
    """Take an obstacle out of the world, or a rack or item, which ``Restore`` and ``MoveObject`` bring back.

    Items on a rack stay with it.
    """

    op: Literal["remove"] = "remove"
    name: str


class Restore(Message):
    """Bring a removed rack or item back to where it was."""

    op: Literal["restore"] = "restore"
    name: str


class MoveObject(Message):
    """Set a rack or an item down elsewhere, at rest. Items on a rack move with it.

    A rack is put on the floor. An item is put on top of the box ``lies_on``, or on a board of the rack of that name:
    ``level`` counts from 0, the lowest; None is the top. Without ``lies_on`` it is put on the floor.
    """

    op: Literal["move_object"] = "move_object"
    name: str
    pose: Pose2
    lies_on: str | None = None
    level: Annotated[int, Field(ge=0)] | None = None


class Push(Message):
    """Push a rack or an item: shift it at once, or hit it.

    ``shift``: x, y (m) and yaw (rad) of its new pose in the frame of its present one. Its height stays, so that a
    carried rack slides on the jack; items on a rack move with it. ``impulse``: x, y in the map frame (N·s), at its
    centre of mass, or ``height`` metres above the floor.
    """

    op: Literal["push"] = "push"
    name: str
    shift: Pose2 | None = None
    impulse: Annotated[tuple[float, float], Field(strict=False)] | None = None
    height: Annotated[float, Field(ge=0, le=5)] | None = None


class MoveRobot(Message):
    """Set a robot down elsewhere, at rest."""

    op: Literal["move_robot"] = "move_robot"
    robot: str
    pose: Pose2


class InjectFault(Message):
    """Cause a fault of ``rackhand.schemas.faults``, or (``active=False``) clear it.

    ``target``: name of the chassis, rack or other thing that has it. ``part``: which of its parts, as one of the legs
    of a rack; None for all of them. ``amount``: how much of it, None for the default. ``pose``: where, or how far.
    """

    op: Literal["fault"] = "fault"
    target: str
    fault: FaultName
    part: Annotated[int, Field(ge=0)] | None = None
    amount: float | None = None
    pose: Pose2 | None = None
    active: bool = True


class Inspect(Message):
    """Ask for the state of the world: time, digest, contacts, participants."""

    op: Literal["inspect"] = "inspect"


Change = Place | Remove | Restore | MoveRobot | MoveObject | Push | InjectFault
"""The requests that change what is in the world: refused, or done whole."""


class WorldRequest(Message):
    request: Annotated[
        Join | Leave | Pause | Advance | SetSpeed | Reset | Change | Inspect,
        Field(discriminator="op"),
    ]


class Contact(Message):
    """A robot's body touched something that is neither floor nor its own: when, who, what, and how hard (N)."""

    stamp: Stamp
    robot: str
    other: str
    force: float


class Touch(Message):
    """Two parts of the world touched: their names in order, and when first and last.

    Parts of a chassis are ``amr1/hull``, ``amr1/wheels`` (casters too) and ``amr1/jack``; all else is one part under
    its name, and the floor is ``floor``. What sleeps in place touches nothing by this count.
    """

    parts: Annotated[tuple[str, str], Field(strict=False)]
    first: Stamp
    last: Stamp


class WorldReply(Message):
    """State of the simulation. ``digest`` is a hash over the stamped states since the run began.

    ``contacts`` lists the first 1,000 begun contacts of robots with what is not floor or load since then;
    ``contact_count`` counts all. ``touches``: all pairs of parts that touched since then, allowed or not.
    """

    clock: Clock
    seed: int
    digest: str
    contact_count: int
    contacts: tuple[Contact, ...] = Field(strict=False)
    touches: tuple[Touch, ...] = Field(default=(), strict=False)
    participants: tuple[str, ...] = Field(strict=False)
    command_stamps: dict[str, int] = Field(description="robot -> stamp that its newest command answers")


class ObjectPose(Message):
    name: str
    position: Vec3
    orientation: Quaternion


class Objects(Message):
    """Ground-truth poses of all that moves: for viewers and tests only."""

    stamp: Stamp
    objects: tuple[ObjectPose, ...] = Field(strict=False)


class SceneGeom(Message):
    """One primitive in its body's frame. Sizes: box half-lengths, sphere r, cylinder and capsule r and half-length."""

    body: str
    shape: Literal["plane", "box", "sphere", "cylinder", "capsule", "ellipsoid", "mesh"]
    size: Vec3
    position: Vec3
    orientation: Quaternion
    rgba: Annotated[np.ndarray, Array("<f4", (4,))]


class Scene(Message):
    """The world's geometry as data, so that a viewer needs no physics. Body ``world`` does not move; latched."""

    stamp: Stamp
    geoms: tuple[SceneGeom, ...] = Field(strict=False)
