"""Worlds of the BARN navigation benchmark (Perille et al. 2020): fields of cylinders that no map shows."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import yaml
from pydantic import ConfigDict, Field, ValidationError

from rackhand.services.sim.world.maps import write_map
from rackhand.worlds.data import Data, Point, PoseTuple, Positive, WorldFileError
from rackhand.worlds.world_model import World

MARGIN = 1.5  # m of floor round the field, the start and the goal


class _Field(Data):
    cylinders: Annotated[tuple[Point, ...], Field(min_length=1)]
    path_length: Positive


class _Meta(Data):
    model_config = ConfigDict(extra="ignore")

    source: str = ""
    cylinder_radius: Positive
    cylinder_height: Positive
    start: PoseTuple
    goal: Point
    goal_radius: Positive
    timeout: Positive


class _Barn(Data):
    """The data file: what holds for all worlds, and the cylinders of each by its number."""

    meta: _Meta
    worlds: dict[str, Any]


def read_barn(file: Path, number: str) -> World:
    """The world of that number. Raises ``WorldFileError``."""
    try:
        data = _Barn.model_validate(json.loads(file.read_text()))
        if number not in data.worlds:
            known = sorted(data.worlds, key=lambda n: (len(n), n))
            raise WorldFileError(f"{file}: no world {number!r}; there are {len(known)}, {known[0]} … {known[-1]}")
        chosen = _Field.model_validate(data.worlds[number])
    except OSError as error:
        raise WorldFileError(f"{file}: cannot be read: {error.strerror}") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        raise WorldFileError(f"{file}: {where or 'the file'}: {first['msg']}") from None
    except ValueError as error:
        raise WorldFileError(f"{file}: not JSON: {error}") from None
    return _world(number, data.meta, chosen)


def _world(number: str, meta: _Meta, field: _Field) -> World:
    points = [*field.cylinders, meta.start[:2], meta.goal]
    xs, ys = [p[0] for p in points], [p[1] for p in points]
    return World.model_validate(
        {
            "version": 1,
            "name": f"barn_{number}",
            "description": f"World {number} of the BARN benchmark.",
            "bounds": (
                round(min(xs) - MARGIN, 3),
                round(min(ys) - MARGIN, 3),
                round(max(xs) + MARGIN, 3),
                round(max(ys) + MARGIN, 3),
            ),
            "robots": {"amr1": {"profile": "jackal", "pose": meta.start, "battery": 1.0}},
            "statics": {
                f"cylinder_{i}": {
                    "kind": "cylinder",
                    "centre": centre,
                    "radius": meta.cylinder_radius,
                    "height": meta.cylinder_height,
                    "mapped": False,
                }
                for i, centre in enumerate(field.cylinders)
            },
            "task": {
                "goal": meta.goal,
                "radius": meta.goal_radius,
                "path_length": field.path_length,
                "timeout": meta.timeout,
                "source": meta.source,
            },
        }
    )


def write_barn_world(file: Path, number: str, folder: Path) -> tuple[Path, ...]:
    """Write ``world.yaml``, its map, and overlays that hold nothing. Raises ``WorldFileError``, ``OSError``."""
    world = read_barn(file, number)
    maps = write_map(world, folder)
    text, overlays = folder / "world.yaml", folder / "overlays.geojson"
    text.write_text(yaml.safe_dump(world.model_dump(mode="json", exclude_defaults=True), sort_keys=False))
    overlays.write_text(json.dumps({"type": "FeatureCollection", "features": []}) + "\n")
    return (text, *maps, overlays)
