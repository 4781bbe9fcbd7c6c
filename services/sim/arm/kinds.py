"""Kinds of arm as data (``worlds/arms/*.xml``, with what an MJCF cannot say in the YAML beside it). SI units."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import ConfigDict, Field

from rackhand.services.sim.errors import WorldFileError
from rackhand.services.sim.world.worldfile import Data, Positive, World, read_model, worlds_root

PerJoint = Annotated[tuple[Positive, ...], Field(min_length=1)]


class ArmKind(Data):
    """What the driver of an arm needs to know; its YAML says more, to its controller.

    ``base`` and ``tool`` are the body of its base frame and the site of its flange; ``velocity`` (rad/s) and
    ``acceleration`` (rad/s²) have one value a joint, base to flange. Joint ranges and torque limits are in the MJCF.
    """

    model_config = ConfigDict(extra="ignore")

    base: str
    tool: str
    home: Annotated[tuple[float, ...], Field(min_length=1)]
    velocity: PerJoint
    acceleration: PerJoint


def arm_file(kind: str) -> Path:
    """The MJCF of a kind of arm."""
    return worlds_root() / "arms" / f"{kind}.xml"


def known_arm_kinds() -> list[str]:
    return sorted(path.stem for path in (worlds_root() / "arms").glob("*.yaml"))


def load_arm_kinds(world: World) -> dict[str, ArmKind]:
    """Arm → its kind. Raises ``WorldFileError``."""
    kinds = {}
    for name, place in world.arms.items():
        if place.kind not in known_arm_kinds():
            raise WorldFileError(
                f"world {world.name}: arms.{name}.kind: {place.kind!r} is not known; known: {known_arm_kinds()}"
            )
        kind = read_model(ArmKind, worlds_root() / "arms" / f"{place.kind}.yaml")
        if place.home is not None and len(place.home) != len(kind.home):
            raise WorldFileError(
                f"world {world.name}: arms.{name}.home: {len(place.home)} values, "
                f"but {place.kind} has {len(kind.home)} joints"
            )
        kinds[name] = kind
    return kinds
