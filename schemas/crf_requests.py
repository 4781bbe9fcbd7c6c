"""The requests of the CRF motion protocol (seed 002; spec motion-controller §1–§6), flat as they are on the wire.

Fields that CRF does not have are optional and marked "extension": every CRF message is valid without them.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, ConfigDict, FailFast, Field, Strict, model_validator
from pydantic.alias_generators import to_camel

from rackhand.schemas.base import Message
from rackhand.schemas.orientation import CrfFloat, TaskPose

MAX_PRIORITY = 2**32 - 1
ALIAS_MARK = "#"
"""First character of the names that clients without a name are given: no ``client`` may begin with it."""


def _whole(value: Any) -> Any:
    """Clients whose language has one number type write 10 as 10.0."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


CrfInt = Annotated[int, BeforeValidator(_whole)]
Priority = Annotated[CrfInt, Field(ge=1, le=MAX_PRIORITY, description="1 is the highest")]
Count = Annotated[CrfInt, Field(ge=0, le=2**63 - 1)]
CrfVector = Annotated[tuple[CrfFloat, ...], Strict(False)]


class CrfMessage(Message):
    model_config = ConfigDict(alias_generator=to_camel, validate_by_name=True, serialize_by_alias=True)


class User(CrfMessage):
    """Who is asking, for the log."""

    model_config = ConfigDict(extra="ignore")

    name: str
    role: str


class Request(CrfMessage):
    """What every request may carry. Unknown fields are ignored, as CRF does."""

    model_config = ConfigDict(extra="ignore")

    command: str
    id: Any = Field(None, description="any JSON; repeated in the answer")
    user: User | None = None
    client: Annotated[str, Field(min_length=1, max_length=128, pattern=f"^[^{ALIAS_MARK}]")] | None = Field(
        None, description="extension: a name of the client that outlives its connection; asks for the lease in replies"
    )


class ControlRequest(Request):
    """A request that needs control of the arm, and takes it if nobody with a smaller number holds it.

    ``leaseId`` and ``epoch`` (extensions) are the fencing token of the grant the command belongs to.
    """

    priority: Priority
    lease_id: CrfInt | None = None
    epoch: Annotated[str, Field(max_length=64)] | None = None
    takeover: Literal["stop", "continue"] = Field(
        "stop",
        description="extension: at a change of holder, stop and clear the queue, or continue the motion",
    )


class LockControl(Request):
    """Takes control, or refreshes it. ``false`` if another client keeps it; the request then waits for it."""

    command: Literal["lockControl"]
    priority: Priority
    keep_alive: CrfFloat | None = Field(None, description="extension: seconds until the lock expires unrefreshed")
    on_loss: Literal["softStop", "finishPath", "hold"] | None = Field(
        None, description="extension: what happens to the motion when control is lost"
    )
    takeover: Literal["stop", "continue"] = "stop"
    force: bool = Field(False, description="extension: take control from a smaller number; needs a role")


class UnlockControl(Request):
    """Gives control back; ``false`` if this client did not hold it. A path that it started is finished."""

    command: Literal["unlockControl"]
    priority: Priority


class ResumeControl(ControlRequest):
    """Extension: allows motion again after another client's stop."""

    command: Literal["resumeControl"]


class AppendJointsPath(ControlRequest):
    """Waypoints [rad], one list a point, driven in order after the queued ones."""

    command: Literal["appendPath"]
    type: Literal["joints"]
    data: Annotated[tuple[CrfVector, ...], Strict(False), FailFast()]


class AppendTaskPath(ControlRequest):
    """Waypoints of the tool. ``method`` 1 joint-space, 2 task-space trajectory; ``reference`` 1 robot base, 2 TCP as
    it is at the call."""

    command: Literal["appendPath"]
    type: Literal["task"]
    data: Annotated[tuple[TaskPose, ...], Strict(False), FailFast()]
    method: CrfInt
    reference: CrfInt


class _Signal(ControlRequest):
    type: Literal["joints", "task"]
    data: CrfVector

    @model_validator(mode="after")
    def _six(self) -> Self:
        if self.type == "task" and len(self.data) != 6:
            raise ValueError(f"data has {len(self.data)} numbers, a task vector has 6")
        return self


class _Stream(_Signal):
    """A reference that ends 100 ms after its last refresh. With the extensions, late and replayed samples are
    detected."""

    reference: CrfInt | None = Field(None, description="mandatory for task: 1 robot base, 2 TCP at reception")
    sequence: Count | None = Field(None, description="extension: grows from sample to sample")
    stamp: Count | None = Field(None, description="extension: ns of world/clock the sample answers")
    timeout: CrfFloat | None = Field(None, description="extension: seconds until this sample expires, at most 0.1")

    @model_validator(mode="after")
    def _referenced(self) -> Self:
        if self.type == "task" and self.reference is None:
            raise ValueError("reference is missing: 1 robot base, 2 TCP")
        return self


class SetVelocity(_Stream):
    """Velocity of the joints [rad/s] or the tool [m/s, rad/s]; ends 100 ms after its last refresh."""

    command: Literal["setVelocity"]


class SetTorque(_Stream):
    """Torque of the joints [N·m] or wrench at the tool [N, N·m], without gravity; ends 100 ms after its last
    refresh."""

    command: Literal["setTorque"]


class SetProfileVelocity(_Signal):
    """Velocity of paths that are appended from now on."""

    command: Literal["setProfileVelocity"]


class SetProfileAcceleration(_Signal):
    """Acceleration of paths that are appended from now on, and deceleration of soft stops."""

    command: Literal["setProfileAcceleration"]


class _Stop(Request):
    """A stop is accepted from any client; ``priority`` counts under ``strictCrf`` only."""

    priority: Priority | None = None


class SoftStop(_Stop):
    """Brakes along the path within the deceleration limits and clears the queue. Accepted from any client."""

    command: Literal["softStop"]


class HardStop(_Stop):
    """Brakes as hard as the joints can and clears the queue. Accepted from any client. Not an emergency stop."""

    command: Literal["hardStop"]


class SetParameters(ControlRequest):
    """Stop conditions and objective functions: all of a call, or none if one is refused."""

    command: Literal["setParameters"]
    data: dict[str, Any]  # raw here: its content is refused with an ``expected``, not with an error


class SetGripper(ControlRequest):
    """Extension: switches the gripper's suction. It neither stops nor queues motion."""

    command: Literal["setGripper"]
    suction: bool


class StartJointsControl(ControlRequest):
    """Begins a control loop of the joints without motion."""

    command: Literal["startJointsControl", "startJointsControlLoop"]


class StartTaskControl(ControlRequest):
    """Begins a control loop of the tool without motion."""

    command: Literal["startTaskControl", "startTaskControlLoop"]


class GetStatus(Request):
    """Measured signals, whether a trajectory runs, who holds control."""

    command: Literal["getStatus"]


class GetConfiguration(Request):
    """Number of joints, limits and profile."""

    command: Literal["getConfiguration"]


class StartStreamStatus(Request):
    """The status as events: ``mode`` 1 at the frequency (Hz), 2 only when something changed."""

    command: Literal["startStreamStatus"]
    frequency: CrfFloat
    mode: CrfInt = 1


class StopStreamStatus(Request):
    """Ends the status stream."""

    command: Literal["stopStreamStatus"]


class StartHeartbeat(Request):
    """Starts supervision: without a ``heartbeat`` for ``period`` seconds this client counts as disconnected."""

    command: Literal["startHeartbeat"]
    period: CrfFloat = Field(description="seconds")


class Heartbeat(Request):
    """Confirms that the client is alive; refreshes its lock too."""

    command: Literal["heartbeat"]


class StopHeartbeat(Request):
    """Ends the supervision."""

    command: Literal["stopHeartbeat"]


def words(model: type[Request]) -> tuple[str, ...]:
    """The values of ``command`` that are this request."""
    spelled: tuple[str, ...] = model.model_fields["command"].annotation.__args__  # type: ignore[union-attr]
    return spelled


def type_of(model: type[Request]) -> str | None:
    """The one value of ``type`` that is this request; ``None`` where it takes several or has none."""
    field = model.model_fields.get("type")
    values: tuple[str, ...] = getattr(field.annotation, "__args__", ()) if field else ()
    return values[0] if len(values) == 1 else None


REQUESTS: tuple[type[Request], ...] = (
    LockControl, UnlockControl, ResumeControl, AppendJointsPath, AppendTaskPath, SetVelocity, SetTorque,
    SetProfileVelocity, SetProfileAcceleration, SoftStop, HardStop, SetParameters, SetGripper, StartJointsControl,
    StartTaskControl, GetStatus, GetConfiguration, StartStreamStatus, StopStreamStatus, StartHeartbeat, Heartbeat,
    StopHeartbeat,
)  # fmt: skip

OPTIONAL_COMMANDS = frozenset(
    word for model in REQUESTS if issubclass(model, ControlRequest) for word in words(model)
) - {"resumeControl"}
"""Commands that a controller may leave out (405), as each kind of CRF controller does with some."""
