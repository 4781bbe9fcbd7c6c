"""The models of ``arms/<kind>.yaml``, which says what the MJCF beside it cannot. SI units."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from rackhand.worlds.data import Data, Point3, Positive, WorldFileError, known_files, read_model
from rackhand.worlds.world_model import World

# The suction gripper: a cup on a short tube, along z of the flange (m).
GRIPPER_LENGTH, GRIPPER_RADIUS = 0.12, 0.025

PerJoint = Annotated[tuple[Positive, ...], Field(min_length=1)]
LinearAngular = tuple[Positive, Positive]


class LinkSphere(Data):
    """A sphere in place of a part of a link in collision checks: ``at`` in the frame of ``body``."""

    name: str
    body: str
    at: Point3
    radius: Positive


class ArmDescription(Data):
    """An arm, with values per joint from base to flange. Joint ranges, torque limits and inertias are in the MJCF.

    ``base`` is the body of the base frame, ``tool`` the site or body of the flange; ``home`` in rad, ``velocity`` in
    rad/s, ``acceleration`` in rad/s², ``jerk`` in rad/s³; ``task_velocity`` and ``task_acceleration`` are (linear,
    angular) limits of the tool in m/s, rad/s and m/s², rad/s². ``self_collision``: pairs of spheres that can meet.
    """

    base: str
    tool: str
    home: Annotated[tuple[float, ...], Field(min_length=1)]
    velocity: PerJoint
    acceleration: PerJoint
    jerk: PerJoint
    task_velocity: LinearAngular
    task_acceleration: LinearAngular
    spheres: tuple[LinkSphere, ...] = ()
    self_collision: tuple[tuple[str, str], ...] = ()

    @model_validator(mode="after")
    def _has_one_value_per_joint(self) -> ArmDescription:
        joints = len(self.home)
        for name in ("velocity", "acceleration", "jerk"):
            if (count := len(getattr(self, name))) != joints:
                raise ValueError(f"{name} has {count} values, but home has {joints}: want one per joint")
        return self

    @model_validator(mode="after")
    def _names_its_spheres(self) -> ArmDescription:
        names = [sphere.name for sphere in self.spheres]
        if twice := {name for name in names if names.count(name) > 1}:
            raise ValueError(f"spheres: {sorted(twice)[0]!r} is used twice")
        for name in (name for pair in self.self_collision for name in pair):
            if name not in names:
                raise ValueError(f"self_collision: {name!r} is not a sphere; expected one of {sorted(names)}")
        return self


def known_arms() -> list[str]:
    """The kinds of arm in the worlds folders."""
    return list(known_files("arms/*.yaml"))


def load_arm_description(kind: str) -> ArmDescription:
    """The description of that kind of arm. Raises ``WorldFileError``."""
    return read_model(ArmDescription, _find(kind))


def arm_mjcf(kind: str) -> Path:
    """The MJCF of that kind of arm, beside its YAML. Raises ``WorldFileError``."""
    path = _find(kind).with_suffix(".xml")
    if not path.is_file():
        raise WorldFileError(f"{path}: is missing; an arm is described by a YAML and an MJCF of the same name")
    return path


def with_arm_kind(world: World, kind: str | None) -> World:
    """The world with every arm of that kind, at its home where the kind is another; unchanged for None."""
    if kind is None:
        return world
    arms = {
        name: place if place.kind == kind else place.model_copy(update={"kind": kind, "home": None})
        for name, place in world.arms.items()
    }
    return world.model_copy(update={"arms": arms})


def load_arm_descriptions(world: World) -> dict[str, ArmDescription]:
    """Arm → its description. Raises ``WorldFileError``."""
    descriptions = {}
    for name, place in world.arms.items():
        try:
            arm_mjcf(place.kind)
            description = load_arm_description(place.kind)
        except WorldFileError as error:
            raise WorldFileError(f"world {world.name}: arms.{name}.kind: {error}") from None
        if place.home is not None and len(place.home) != len(description.home):
            raise WorldFileError(
                f"world {world.name}: arms.{name}.home: {len(place.home)} values, "
                f"but {place.kind} has {len(description.home)} joints"
            )
        descriptions[name] = description
    return descriptions


def _find(kind: str) -> Path:
    known = known_files("arms/*.yaml")
    if kind not in known:
        raise WorldFileError(f"arm {kind!r} is not known; known: {list(known)}")
    return known[kind]
