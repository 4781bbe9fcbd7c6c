"""The ``data`` of CRF's ``setParameters``: stop conditions and objective functions (spec motion-controller §6).

Field names are Python's; the wire has CRF's spelling (``StopConditions``) through aliases.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Field, Strict, model_validator
from pydantic.alias_generators import to_pascal

from rackhand.schemas.base import Message, Vec3
from rackhand.schemas.crf_requests import CrfVector

Numbers = Annotated[tuple[float, ...], Strict(False)]


class PascalMessage(Message):
    """Fields whose names begin with capitals on the wire."""

    model_config = ConfigDict(alias_generator=to_pascal, validate_by_name=True, serialize_by_alias=True)


class StopConditions(PascalMessage):
    """``None`` leaves a condition as it is."""

    stop_on_low_manipulability: bool | None = None
    stop_on_tolerance_violation: bool | None = None
    stop_on_computation_time_violation: bool | None = None
    stop_on_workspace_violation: bool | None = None


class DesiredJointPosition(PascalMessage):
    """NaN leaves a joint free."""

    attraction_position: CrfVector


class Objective(Message):
    """An objective function: switched with ``enable`` (blended over ``blend`` seconds), weighted by ``c``, shaped by
    ``p``. ``None`` leaves a value as it is."""

    enable: bool | None = None
    c: Annotated[float, Field(ge=0)] | None = None
    p: Annotated[float, Field(ge=0)] | None = None
    blend: Annotated[float, Field(ge=0, le=60)] | None = None


class SphereObjective(Objective):
    """Keeps the arm out of a sphere given in the base frame, metres."""

    center: Vec3 | None = None
    radius: Annotated[float, Field(gt=0)] | None = None


class ObjectiveFunctions(PascalMessage):
    joint_limits: Objective | None = None
    desired_joint_positions: Objective | None = None
    manipulability: Objective | None = None
    collision_avoidance_sphere: Annotated[tuple[SphereObjective, ...], Strict(False)] | None = None

    @model_validator(mode="before")
    @classmethod
    def _one_sphere(cls, value: Any) -> Any:
        one = value.get("CollisionAvoidanceSphere") if isinstance(value, dict) else None
        return {**value, "CollisionAvoidanceSphere": [one]} if isinstance(one, dict) else value


class ControllerParameters(PascalMessage):
    stop_conditions: StopConditions | None = None
    desired_joint_position: DesiredJointPosition | None = None
    update_joints_initial_position: Numbers | None = None
    objective_functions: ObjectiveFunctions | None = None

    @model_validator(mode="before")
    @classmethod
    def _conditions_one_level_up(cls, value: Any) -> Any:
        """CRF looks for the conditions in ``StopConditions`` and reads them beside it; both places are taken."""
        if not isinstance(value, dict):
            return value
        flags = {key: flag for key, flag in value.items() if isinstance(key, str) and key.startswith("StopOn")}
        if not flags:
            return value
        inner = value.get("StopConditions", {})
        rest = {key: item for key, item in value.items() if key not in flags}
        return {**rest, "StopConditions": {**flags, **inner} if isinstance(inner, dict) else inner}


class Parameters(PascalMessage):
    """The ``data`` of ``setParameters``."""

    controller: ControllerParameters
