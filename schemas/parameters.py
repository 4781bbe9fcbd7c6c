"""The parameters that a client may change of a chassis: what it drives with, within its own limits."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from rackhand.schemas.base import Message

SmoothLevel = Literal["disabled", "lower", "normal", "higher"]

KEYS = {
    "max_forward_velocity": "/wheel_control/max_forward_velocity",
    "max_backward_velocity": "/wheel_control/max_backward_velocity",
    "max_forward_acc": "/wheel_control/max_forward_acc",
    "max_forward_decel": "/wheel_control/max_forward_decel",
    "max_angular_velocity": "/wheel_control/max_angular_velocity",
    "smooth_level": "/wheel_control/acc_smoother/smooth_level",
    "auto_hold": "/planning/auto_hold",
    "bump_tolerance": "/control/bump_tolerance",
    "bump_based_speed_limit": "/control/bump_based_speed_limit/enable",
}
"""The name of each parameter in the chassis API, by its field; in that API's order."""


class Parameters(Message):
    """Velocities in m/s and rad/s, accelerations in m/s²; those of driving backward and of braking are negative.

    ``smooth_level``, ``auto_hold`` and the two of bumps are kept for clients and have no effect on this chassis.
    """

    max_forward_velocity: float
    max_backward_velocity: float
    max_forward_acc: float
    max_forward_decel: float
    max_angular_velocity: float
    smooth_level: SmoothLevel = "normal"
    auto_hold: bool = True
    bump_tolerance: float = 0.5
    bump_based_speed_limit: bool = True


class ParameterChanges(Message):
    """New values of some parameters, as in ``Parameters``; None leaves one as it is."""

    max_forward_velocity: float | None = None
    max_backward_velocity: float | None = None
    max_forward_acc: float | None = None
    max_forward_decel: float | None = None
    max_angular_velocity: float | None = None
    smooth_level: SmoothLevel | None = None
    auto_hold: bool | None = None
    bump_tolerance: float | None = None
    bump_based_speed_limit: bool | None = None


class GetParameters(Message):
    op: Literal["get"] = "get"


class SetParameters(Message):
    """All of the changes, or none: refused as ``invalid`` if one is out of range."""

    op: Literal["set"] = "set"
    changes: ParameterChanges


class ParametersRequest(Message):
    """Read or change the parameters of a chassis; refused as ``unavailable`` before its driver has described it."""

    request: Annotated[GetParameters | SetParameters, Field(discriminator="op")]


class ParametersReply(Message):
    """``values`` are in force; ``defaults`` are those of the chassis, which no value exceeds."""

    values: Parameters
    defaults: Parameters
