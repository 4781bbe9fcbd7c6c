"""The parameters that a client may change of a chassis: what it drives with, within its own limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

from pydantic import Field, Strict

from rackhand.schemas.base import Message
from rackhand.schemas.racks import RackSpec

SmoothLevel = Literal["disabled", "lower", "normal", "higher"]
RackSpecs = Annotated[tuple[RackSpec, ...], Strict(False), Field(max_length=50)]


@dataclass(frozen=True)
class Setting:
    """A parameter as ``/system/settings`` shows it. ``old_key``: its name in ``/robot-params``; empty: it has none."""

    field: str
    name: str
    type: Literal["float", "bool", "Enum", "RackSpecs"]
    description: str
    old_key: str = ""
    options: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """``control.max_forward_velocity`` is Control: Max Forward Velocity."""
        return ": ".join(part.replace("_", " ").title() for part in self.name.split("."))


NO_EFFECT = "no effect on this chassis: kept and returned"
SETTINGS = (
    Setting(
        "max_forward_velocity",
        "control.max_forward_velocity",
        "float",
        "m/s; 0 holds a move without ending it, until it is raised",
        "/wheel_control/max_forward_velocity",
    ),
    Setting(
        "max_backward_velocity",
        "control.max_backward_velocity",
        "float",
        "m/s, negative; 0: never backward",
        "/wheel_control/max_backward_velocity",
    ),
    Setting(
        "max_forward_acc",
        "control.max_forward_acc",
        "float",
        "m/s² of speeding up",
        "/wheel_control/max_forward_acc",
    ),
    Setting(
        "max_forward_decel",
        "control.max_forward_decel",
        "float",
        "m/s², negative, of slowing down as planned; for obstacles, holds and the emergency stop the chassis brakes as "
        "hard as it can",
        "/wheel_control/max_forward_decel",
    ),
    Setting(
        "max_angular_velocity",
        "control.max_angular_velocity",
        "float",
        "rad/s; 0 holds a move without ending it, until it is raised",
        "/wheel_control/max_angular_velocity",
    ),
    Setting(
        "smooth_level",
        "control.acc_smoother.smooth_level",
        "Enum",
        "limits the jerk of speeding up and of foreseen stops: an acceleration builds up in 0.12 s (lower), 0.2 s "
        "(normal) or 0.4 s (higher), or at once (disabled); where the speed must fall faster it falls at once",
        "/wheel_control/acc_smoother/smooth_level",
        options=("disabled", "lower", "normal", "higher"),
    ),
    Setting(
        "auto_hold",
        "control.auto_hold",
        "bool",
        f"{NO_EFFECT}; the wheels of an idle chassis are always held",
        "/planning/auto_hold",
    ),
    Setting(
        "bump_tolerance",
        "bump_based_speed_limit.bump_tolerance",
        "float",
        f"{NO_EFFECT}; it does not measure how uneven the floor is",
        "/control/bump_tolerance",
    ),
    Setting(
        "bump_based_speed_limit",
        "bump_based_speed_limit.enable",
        "bool",
        f"{NO_EFFECT}; it does not measure how uneven the floor is",
        "/control/bump_based_speed_limit/enable",
    ),
    Setting(
        "remote_max_forward_velocity",
        "control.remote_mode.max_forward_velocity",
        "float",
        "m/s in control mode remote",
    ),
    Setting(
        "weight_based_speed_limit",
        "weight_based_speed_limit.enable",
        "bool",
        "lower the velocities of a loaded chassis: by the share of the jack's greatest load that is on it",
    ),
    Setting(
        "weight_min_linear",
        "weight_based_speed_limit.min_linear",
        "float",
        "m/s, to which a load lowers the forward velocity at most",
    ),
    Setting(
        "weight_min_angular",
        "weight_based_speed_limit.min_angular",
        "float",
        "rad/s, to which a load lowers the angular velocity at most",
    ),
    Setting(
        "footprint_expansion",
        "robot.footprint_expansion",
        "float",
        "m by which expanded_footprint of /robot_model is larger than footprint; driving is not affected",
    ),
    Setting(
        "ignore_objects_under_rack",
        "safety.ignore_objects_under_rack",
        "bool",
        "false: a move with a rack is held while the lidar sees something under the rack that is none of its legs",
    ),
    Setting(
        "refuse_moves_while_jacking",
        "jack.refuse_moves_while_jacking",
        "bool",
        "true: a move posted while the jack moves is refused with 400; false: it is accepted and held until the jack "
        "has arrived (an extension)",
    ),
    Setting(
        "search_limit",
        "planning.search_limit",
        "float",
        "places that a search for a path may try; a move whose path is not found by then fails with 10 (an extension)",
    ),
    Setting(
        "rack_specs",
        "rack.specs",
        "RackSpecs",
        "the kinds of racks that may be lifted, from the next move on: a list of objects, in metres; a rack belongs to "
        "a kind if width and depth over its legs differ by less than 5 cm",
    ),
)
"""All settings, in the order in which they are shown."""

KEYS = {row.field: row.old_key for row in SETTINGS if row.old_key}
"""The name of each parameter that ``/robot-params`` has, by its field; in that API's order."""
NAMES = {row.field: row.name for row in SETTINGS}
"""The name of each parameter in ``/system/settings``, by its field."""


class DriveParameters(Message):
    """Velocities in m/s and rad/s, accelerations in m/s²; those of driving backward and of braking are negative.

    ``auto_hold`` and the two of bumps are kept for clients and have no effect on this chassis.
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


class Parameters(DriveParameters):
    """All parameters; what each does is in ``SETTINGS``."""

    remote_max_forward_velocity: float = 0.8
    weight_based_speed_limit: bool = True
    weight_min_linear: float = 0.4
    weight_min_angular: float = 0.4
    footprint_expansion: float = 0.0
    ignore_objects_under_rack: bool = True
    refuse_moves_while_jacking: bool = False
    search_limit: float = 6_000_000.0
    rack_specs: RackSpecs = ()


class DriveParameterChanges(Message):
    """New values of some of ``DriveParameters``; None leaves one as it is."""

    max_forward_velocity: float | None = None
    max_backward_velocity: float | None = None
    max_forward_acc: float | None = None
    max_forward_decel: float | None = None
    max_angular_velocity: float | None = None
    smooth_level: SmoothLevel | None = None
    auto_hold: bool | None = None
    bump_tolerance: float | None = None
    bump_based_speed_limit: bool | None = None


class ParameterChanges(DriveParameterChanges):
    """New values of some of ``Parameters``; None leaves one as it is."""

    remote_max_forward_velocity: float | None = None
    weight_based_speed_limit: bool | None = None
    weight_min_linear: float | None = None
    weight_min_angular: float | None = None
    footprint_expansion: float | None = None
    ignore_objects_under_rack: bool | None = None
    refuse_moves_while_jacking: bool | None = None
    search_limit: float | None = None
    rack_specs: RackSpecs | None = None


class Range(Message):
    """Of a number; both ends belong to it."""

    low: float
    high: float
    unit: str

    def __str__(self) -> str:
        return f"{self.low:g} … {self.high:g} {self.unit}".rstrip()


class GetParameters(Message):
    op: Literal["get"] = "get"


class SetParameters(Message):
    """All of the changes, or none: refused as ``invalid`` if one is out of range.

    ``reset``: fields that return to their defaults. ``replace``: all that is not among the changes does. ``names``:
    which names a refusal uses, those of ``/system/settings`` or of ``/robot-params``.
    """

    op: Literal["set"] = "set"
    changes: ParameterChanges
    reset: Annotated[tuple[str, ...], Strict(False)] = ()
    replace: bool = False
    names: Literal["settings", "robot_params"] = "settings"


class ParametersRequest(Message):
    """Read or change the parameters of a chassis; refused as ``unavailable`` before its driver has described it."""

    VERSION: ClassVar[int] = 2

    request: Annotated[GetParameters | SetParameters, Field(discriminator="op")]


class ParametersReply(Message):
    """``values`` are in force; ``defaults`` are those of the chassis, which no velocity or acceleration exceeds;
    ``user`` is what has been set; ``ranges`` are those of the numbers, by field.
    """

    VERSION: ClassVar[int] = 2

    values: Parameters
    defaults: Parameters
    user: ParameterChanges
    ranges: dict[str, Range]
