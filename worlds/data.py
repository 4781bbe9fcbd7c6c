"""What all data files have in common: how they are found, read, and refused.

A worlds folder holds worlds (``<world>/world.yaml``), chassis (``chassis/<profile>.yaml``) and arms
(``arms/<kind>.yaml`` with ``arms/<kind>.xml``). The environment variable ``RACKHAND_WORLDS`` names further ones,
separated as in ``PATH``; they come before the one that is installed with rackhand.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

M = TypeVar("M", bound=BaseModel)
Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Point = tuple[float, float]
Point3 = tuple[float, float, float]
PoseTuple = tuple[float, float, float]
Size3 = tuple[Positive, Positive, Positive]
Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=40)]

WORLDS_PATH = "RACKHAND_WORLDS"


class WorldFileError(Exception):
    """A world, profile or data file is wrong; the text says which file, where in it, and what was expected."""


class Data(BaseModel):
    """The base of all that is read from a file: frozen, finite, closed to unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _knows_all_keys(cls, value: Any) -> Any:
        """Before pydantic says that a key is not permitted: say which ones are."""
        if isinstance(value, dict) and cls.model_config["extra"] == "forbid":
            unknown = [key for key in value if key not in cls.model_fields]
            if unknown:
                raise ValueError(f"unknown key {unknown[0]!r}; known: {sorted(cls.model_fields)}")
        return value


def worlds_folders() -> tuple[Path, ...]:
    """The worlds folders, in the order in which they are searched."""
    further = os.environ.get(WORLDS_PATH, "").split(os.pathsep)
    return (*(Path(folder) for folder in further if folder), Path(__file__).parent)


def installed_worlds() -> Path:
    """The worlds folder that is installed with rackhand."""
    return Path(__file__).parent


def known_files(pattern: str) -> dict[str, Path]:
    """Name of the file without its suffix → its path, for all files of the worlds folders that match ``pattern``."""
    found: dict[str, Path] = {}
    for folder in worlds_folders():
        for path in sorted(folder.glob(pattern)):
            found.setdefault(path.stem, path)
    return dict(sorted(found.items()))


def read_model(model: type[M], path: Path) -> M:
    """A file's YAML as ``model``. Raises ``WorldFileError``."""
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise WorldFileError(f"{path}: cannot be read: {error}") from None
    except yaml.YAMLError as error:
        raise WorldFileError(f"{path}: not YAML: {' '.join(str(error).split())}") from None
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise WorldFileError("\n".join(f"{path}: {_explain(item)}" for item in error.errors())) from None


def _explain(item: Any) -> str:
    """One validation error as ``movers.anna.motion.walk: unknown key 'spede'; known: …``."""
    where = ".".join(str(part) for part in item["loc"]) or "the file"
    return f"{where}: {item['msg'].removeprefix('Value error, ')}"
