"""The models of ``chassis/<profile>.yaml``. Chassis frame: x forward, y left, z up, origin on the floor
midway between the driven wheels. SI units.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Actuation, ChassisLimits, ChassisModel, JackModel, LidarModel
from rackhand.worlds.data import (
    Data,
    NonNegative,
    Point,
    PoseTuple,
    Positive,
    Size3,
    WorldFileError,
    known_files,
    read_model,
)
from rackhand.worlds.world_model import CONTROL_STEP_NS, World


class ChassisBody(Data):
    """A box l×w×h whose underside is ``clearance`` above the floor; ``centre`` is its middle in the chassis frame."""

    size: Size3
    clearance: Positive
    mass: Positive
    centre: Point = (0.0, 0.0)


class WheelDrive(Data):
    """Two driven wheels. ``acceleration``, ``deceleration`` (m/s²) and ``angular_acceleration`` (rad/s²) are what the
    drive itself holds to. ``braking`` (m/s² of each wheel's rim) is how it stops when it must: as
    hard as the wheels' grip allows, and a little more; ``braking_loaded``: the same with something on the jack,
    which must neither slide nor fall. ``gain`` (N·m·s/rad) of the
    velocity servo: gain · timestep must stay below ``rotor_inertia`` (kg·m², of motor and gear, at the wheel), or a
    servo at its torque limit chatters.
    """

    wheel_radius: Positive
    wheel_separation: Positive
    wheel_width: Positive = 0.04
    wheel_mass: Positive = 1.0
    max_linear: Positive
    max_angular: Positive
    acceleration: Positive
    deceleration: Positive
    angular_acceleration: Positive
    braking: Positive
    braking_loaded: Positive = 1.5
    torque: Positive
    gain: Positive
    rotor_inertia: Positive
    friction: Positive = 0.9


class Casters(Data):
    radius: Positive
    positions: Annotated[tuple[Point, ...], Field(min_length=1)]


class JackKind(Data):
    """A plate l×w×h on a slide; the spindle takes ``duration`` seconds for ``stroke``.

    ``force`` (N): the motor turns the spindle upward against no more than that, plate included. It is self-locking:
    it bears more than it lifts. ``friction``: between the plate and what it carries.
    """

    stroke: Positive
    duration: Positive
    plate: Size3
    mass: Positive
    force: Positive
    max_load: Positive
    friction: Positive = 0.5

    @model_validator(mode="after")
    def _lifts_its_load(self) -> JackKind:
        if (needed := (self.mass + self.max_load) * 9.81) > self.force:
            raise ValueError(f"force {self.force:g} N does not lift max_load {self.max_load:g} kg: want {needed:.0f} N")
        return self


class LidarKind(Data):
    """``pose`` in the chassis frame at ``height``; ``view`` is the angle that is seen; ``rate`` in scans a second;
    ``noise`` 1σ in metres.
    """

    pose: PoseTuple
    height: Positive
    beams: Annotated[int, Field(gt=1)]
    view: Annotated[float, Field(gt=0, le=2 * math.pi + 1e-6)]
    rate: Positive
    range_max: Positive = 25.0
    noise: NonNegative = 0.01

    @field_validator("rate")
    @classmethod
    def _fits_the_control_step(cls, rate: float) -> float:
        steps = 1e9 / (rate * CONTROL_STEP_NS)
        if steps < 1 or not math.isclose(steps, round(steps), rel_tol=1e-9):
            step = CONTROL_STEP_NS * 1e-9
            raise ValueError(f"{rate:g} Hz: the time between two scans must be a whole number of {step:g} s")
        return rate

    @property
    def period_ns(self) -> int:
        """Time between two scans."""
        return round(1e9 / self.rate)

    @property
    def whole_circle(self) -> bool:
        return self.view > 2 * math.pi - 1e-3

    @property
    def angle_min(self) -> float:
        return -self.view / 2

    @property
    def angle_step(self) -> float:
        """Between beams; on a whole circle the last beam must not fall on the first."""
        return self.view / (self.beams if self.whole_circle else self.beams - 1)


class BatteryKind(Data):
    """Capacity in Wh; consumption in W at rest, W per m/s of speed, W while the jack moves; charging power in W."""

    capacity: Positive
    voltage_empty: Positive
    voltage_full: Positive
    idle: Positive
    per_speed: Positive
    jacking: NonNegative = 0.0
    charging: Positive


class ChassisProfile(Data):
    """One chassis, whole: what its driver publishes of it, and what only the physics needs."""

    name: str
    body: ChassisBody
    limits: ChassisLimits  # the drive itself goes further, so that it follows these
    actuation: Actuation
    drive: WheelDrive
    casters: Casters
    jack: JackKind | None = None
    lidar: LidarKind
    battery: BatteryKind
    charge_contact: Literal["none", "front", "back"] = "none"

    @model_validator(mode="after")
    def _drive_reaches_its_limits(self) -> ChassisProfile:
        able = {
            "forward": self.drive.max_linear,
            "reverse": self.drive.max_linear,
            "angular": self.drive.max_angular,
            "acceleration": self.drive.acceleration,
            "deceleration": self.drive.deceleration,
            "angular_acceleration": self.drive.angular_acceleration,
        }
        for name, most in able.items():
            if (limit := getattr(self.limits, name)) > most:
                raise ValueError(f"limits.{name} is {limit:g}, but the drive reaches only {most:g}")
        return self

    @property
    def height(self) -> float:
        """Metres from the floor to the highest point, with the jack down."""
        plate = 0.0 if self.jack is None else self.jack.plate[2]
        return self.body.clearance + self.body.size[2] + plate

    @property
    def footprint(self) -> NDArray[np.float64]:
        """The outline of the body, (4, 2), counter-clockwise in the chassis frame."""
        length, width, _ = self.body.size
        corners = np.array([(1, -1), (1, 1), (-1, 1), (-1, -1)]) * (length / 2, width / 2)
        return np.asarray(corners + np.array(self.body.centre), dtype=np.float64)

    def describe(self) -> ChassisModel:
        """What the driver publishes of this chassis."""
        jack, lidar = self.jack, self.lidar
        x, y, yaw = lidar.pose
        return ChassisModel(
            name=self.name,
            footprint=self.footprint,
            height=self.height,
            wheel_separation=self.drive.wheel_separation,
            wheel_radius=self.drive.wheel_radius,
            limits=self.limits,
            actuation=self.actuation,
            lidar=LidarModel(pose=Pose2(x=x, y=y, yaw=yaw), **lidar.model_dump(exclude={"pose"})),
            jack=None
            if jack is None
            else JackModel(stroke=jack.stroke, duration=jack.duration, max_load=jack.max_load),
            charge_contact=self.charge_contact,
        )


def known_profiles() -> list[str]:
    """The names of the chassis in the worlds folders."""
    return list(known_files("chassis/*.yaml"))


def load_profiles(world: World, override: str | None = None) -> dict[str, ChassisProfile]:
    """Robot → its profile, or ``override`` for all of them. Raises ``WorldFileError``."""
    if override is not None:
        return dict.fromkeys(world.robots, load_profile(override))
    profiles = {}
    for robot, place in world.robots.items():
        try:
            profiles[robot] = load_profile(place.profile)
        except WorldFileError as error:
            raise WorldFileError(f"world {world.name}: robots.{robot}.profile: {error}") from None
    return profiles


def load_profile(name: str) -> ChassisProfile:
    """The profile of that name. Raises ``WorldFileError``."""
    known = known_files("chassis/*.yaml")
    if name not in known:
        raise WorldFileError(f"chassis profile {name!r} is not known; known: {list(known)}")
    return read_model(ChassisProfile, known[name])
