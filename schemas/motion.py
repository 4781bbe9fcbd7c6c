"""The CRF motion protocol apart from its requests (seed 002; spec motion-controller §1–§6), and what an arm
and its controller say to each other.

Field names are Python's; the wire has CRF's spelling (``priorityUnderControl``, ``JointLimits``) through aliases.
SI units: m, rad, s, N, N·m. Task vectors are linear xyz, then angular xyz. Fields that CRF does not have are optional
and marked "extension": every CRF message is valid without them.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Annotated, Any, Generic, Literal, Self, TypeVar

import numpy as np
from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    Strict,
    model_serializer,
    model_validator,
)
from pydantic.alias_generators import to_pascal

from rackhand.schemas.base import Array, Message, Quaternion, Stamp, Vec3, Vec6
from rackhand.schemas.crf import CrfCode
from rackhand.schemas.crf_contact import Contact
from rackhand.schemas.crf_parameters import Numbers, PascalMessage
from rackhand.schemas.crf_requests import CrfInt, CrfMessage, CrfVector
from rackhand.schemas.orientation import CrfVec6, TaskPose

T = TypeVar("T")


class RefusalDetail(IntEnum):
    """The ``detail`` of a refusal that CRF has no code for. CRF's own refusals keep 0."""

    NONE = 0
    HELD_BY_EQUAL = 1
    STOP_LATCHED = 2
    PRIORITY_RESERVED = 3
    STALE_LEASE = 4
    STALE_SAMPLE = 5


# -- answers ----------------------------------------------------------------------------------------------------------


class Expected(CrfMessage, Generic[T]):
    """CRF's ``expected<T>``: a code with the value, if there is one. ``detail`` is 0 or a ``RefusalDetail``."""

    value: T | None = None
    code: CrfInt
    detail: CrfInt = 0

    @model_serializer(mode="wrap")
    def _without_absent_value(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: item for key, item in handler(self).items() if key != "value" or item is not None}

    @classmethod
    def of(cls, value: T) -> Self:
        return cls(value=value, code=CrfCode.OK)

    @classmethod
    def failed(cls, code: int, detail: int = 0) -> Self:
        return cls(code=int(code), detail=detail)


class Reply(CrfMessage):
    """What CRF answers with: a reply, an error (``replyCommand`` "error") or an event (no ``id``).

    ``text``, ``leaseId``, ``epoch`` and ``keepAlive`` are extensions: why a command was refused, and what a named
    client was granted.
    """

    command: Literal["reply"] = "reply"
    reply_command: str
    message: Any
    id: Any = None
    text: str | None = None
    lease_id: int | None = None
    epoch: str | None = None
    keep_alive: float | None = None


# -- status, configuration, parameters --------------------------------------------------------------------------------

_STATUS_WORDS = {"initialized": "initialize", "deinitialized": "deinitialize"}


class Holder(CrfMessage):
    """Extension: who holds control. ``leaseAge`` in seconds since the last refresh."""

    client: str
    priority: int
    lease_id: int
    lease_age: float


class Gripper(Message):
    """A suction gripper: whether its pump is on, and whether it holds something that seals its cup."""

    suction: bool
    holding: bool


class MotionStatus(CrfMessage):
    """The answer to ``getStatus`` and the content of a ``streamStatus`` event."""

    status: Annotated[
        Literal["initialize", "deinitialize"],
        BeforeValidator(lambda word: _STATUS_WORDS.get(word, word) if isinstance(word, str) else word),
    ]
    priority_under_control: int
    is_trajectory_running: Expected[bool]
    controller_status: Annotated[tuple[int, ...], Strict(False)]
    joint_positions: Expected[CrfVector]
    joint_velocities: Expected[CrfVector]
    joint_accelerations: Expected[CrfVector]
    joint_force_torques: Expected[CrfVector]
    task_pose: Expected[TaskPose]
    task_velocity: Expected[CrfVec6]
    task_acceleration: Expected[CrfVec6]
    task_force_torque: Expected[CrfVec6]
    stamp: Stamp | None = Field(None, description="extension: ns of world/clock")
    epoch: str | None = Field(None, description="extension: changes when the controller restarts")
    holder: Holder | None = Field(None, description="extension")
    stopped_by: str | None = Field(None, description="extension: the client whose stop is latched")
    gripper: Gripper | None = Field(None, description="extension, of an arm that has one")
    contact: Contact | None = Field(None, description="extension: the last one since the last motion began")

    @model_validator(mode="after")
    def _sorted(self) -> Self:
        if list(self.controller_status) != sorted(set(self.controller_status)):
            raise ValueError("controllerStatus is ascending without duplicates")
        return self


class TaskSpace(PascalMessage):
    """Which of the six task dimensions are used."""

    vx: bool = True
    vy: bool = True
    vz: bool = True
    wx: bool = True
    wy: bool = True
    wz: bool = True


class ConfiguredJointLimits(PascalMessage):
    max_position: CrfVector
    min_position: CrfVector
    max_velocity: CrfVector
    max_acceleration: CrfVector
    max_torque: CrfVector


class ConfiguredTaskLimits(PascalMessage):
    max_velocity: CrfVec6
    max_acceleration: CrfVec6


class ProfileParameters(PascalMessage):
    joint_velocities: CrfVector
    joint_accelerations: CrfVector
    task_velocity: CrfVec6
    task_acceleration: CrfVec6


class RobotConfiguration(PascalMessage):
    """The answer to ``getConfiguration``: what concerns clients, without addresses and gains."""

    joint_space_degree_of_freedom: Annotated[int, Field(ge=1)]
    controller_loop_time_ms: Annotated[float, Field(gt=0)]
    joint_limits: ConfiguredJointLimits
    task_limits: ConfiguredTaskLimits
    profile_parameters: ProfileParameters
    task_space_degree_of_freedom: Annotated[int, Field(ge=0, le=6)] = 6
    task_space: TaskSpace = TaskSpace()

    @model_validator(mode="after")
    def _dimensions(self) -> Self:
        joints = self.joint_space_degree_of_freedom
        vectors = [*((f"JointLimits.{to_pascal(name)}", value) for name, value in self.joint_limits),
                   ("ProfileParameters.JointVelocities", self.profile_parameters.joint_velocities),
                   ("ProfileParameters.JointAccelerations", self.profile_parameters.joint_accelerations)]  # fmt: skip
        for name, value in vectors:
            if len(value) != joints:
                raise ValueError(f"{name} has {len(value)} numbers, the robot {joints} joints")
        return self


# -- on the bus -------------------------------------------------------------------------------------------------------


CONNECTION = "connection:"
"""How the names of sessions begin that are connections: their end is reported by ``SessionGone``."""


class CrfCall(Message):
    """A CRF request as it came, and the session it came through. Text, so that even broken JSON gets its answer."""

    session: Annotated[str, Field(min_length=1, max_length=128)]
    text: str


class CrfAnswer(Message):
    """A CRF reply as JSON text."""

    text: str


class MotionStream(Message):
    """A ``streamStatus`` event as JSON text, for the session that asked for it."""

    session: Annotated[str, Field(min_length=1, max_length=128)]
    text: str


class SessionGone(Message):
    """The connection behind this session is closed: whatever it held is let go, as the protocol has it."""

    session: Annotated[str, Field(min_length=1, max_length=128)]


EventName = Literal["controlGranted", "controlLost", "stopped", "resumed", "heartbeatLost", "contact"]
LossReason = Literal["released", "expired", "preempted", "forced", "disconnected", "heartbeat", "promoted", "restart"]


class ControlInfo(CrfMessage):
    """What happened to control: to whom, by whom, why. ``kind`` says which stop it was."""

    client: str
    priority: int
    lease_id: int
    epoch: str
    by: str | None = None
    by_priority: int | None = None
    reason: str | None = None
    kind: Literal["softStop", "hardStop"] | None = None


class MotionEvent(Message):
    """An unsolicited CRF event. ``to`` names the client it concerns; empty, all."""

    stamp: Stamp
    name: EventName
    to: str = ""
    info: ControlInfo | Contact


class FencingToken(Message):
    """Which grant a command belongs to. Within an epoch a larger ``lease`` is newer; a restart makes a new epoch."""

    epoch: Annotated[str, Field(min_length=1, max_length=64)]
    lease: Annotated[int, Field(ge=0)]


class Following(Message):
    """The command that an arm's driver follows: its token, and the state it answers. No token: it follows none."""

    token: FencingToken | None = None
    answers: Stamp = 0


class ArmState(Message):
    """What an arm's driver measures: rad, rad/s, N·m, one entry a joint; wrench at the flange in its frame; the gripper
    of an arm that has one; and the command it ``follows``, by which a controller knows whether it is obeyed (a driver
    that leaves it out is trusted). ``efforts`` are means since the state before, where the driver can tell."""

    stamp: Stamp
    q: Numbers
    dq: Numbers
    efforts: Numbers
    wrench: Vec6
    gripper: Gripper | None = None
    follows: Following | None = None

    @model_validator(mode="after")
    def _same_length(self) -> Self:
        if not self.q or not len(self.q) == len(self.dq) == len(self.efforts):
            raise ValueError(f"{len(self.q)} positions, {len(self.dq)} velocities, {len(self.efforts)} efforts")
        return self


# A driver takes a stream of positions to go on as it went for so many of its intervals, from when the newest command
# takes effect: what is missing then is late or was lost. After them the stream has ended, and the driver brakes.
STREAM_INTERVALS = 3


class ArmCommand(Message):
    """What the driver is to do: rad, rad/s or N·m (gravity is the driver's). ``answers``: stamp of the state used.

    Commands that are late or lost are bridged for ``STREAM_INTERVALS``, after which the arm brakes.
    ``suction`` switches the gripper, and stays in force when commands fall silent: a driver stops motion then, but
    drops nothing.
    """

    answers: Stamp
    mode: Literal["position", "velocity", "torque"]
    values: Annotated[Numbers, Field(min_length=1)]
    token: FencingToken
    suction: bool = False


class ArmModel(Message):
    """Which arm it is, and the pose of its base frame in the map: metres and a quaternion."""

    kind: str
    position: Vec3
    orientation: Quaternion


class MotionPath(Message):
    """The way of the tool through all that is queued, and what it is made of; empty when nothing is.

    ``points`` are rows of x, y, z in the arm's base frame, in metres, evenly spaced in time. ``ends`` are the rows at
    which one motion of the queue ends.
    """

    stamp: Stamp
    points: Annotated[np.ndarray, Array("<f4", (-1, 3))]
    ends: Annotated[tuple[int, ...], Strict(False)] = ()


class MotionDiagnostics(Message):
    """How well the loop does. Errors are measured minus commanded values of the same stamp.

    ``target_position`` and ``target_orientation``: the tool as commanded, in the base frame. Durations are the longest
    since the last message, in µs of the machine's time; ``late_ticks`` counts since the controller began.
    """

    stamp: Stamp
    target_position: Vec3
    target_orientation: Quaternion
    joint_errors: Numbers
    linear_error: float
    angular_error: float
    tick_us: float
    solver_us: float
    solver_iterations: int
    late_ticks: int
