"""Reads a map from a directory as worlds keep it: ``map.yaml`` (ROS), the PNG it names, ``overlays.geojson``."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from rackhand.schemas.codec import MalformedMessage, codec_for, explain
from rackhand.schemas.maps import CreateMap
from rackhand.schemas.refusal import RequestRefused
from rackhand.services.planner.map.check import check_map
from rackhand.services.planner.map.reading import Reading, stored_png


class MapDirectoryError(Exception):
    """The directory holds no map that can be used; the text says which file and why."""


@dataclass(frozen=True)
class DirectoryMap:
    """A map and when its files were last changed (unix seconds). Its uid is a hash of all that is in it."""

    map: CreateMap
    changed: int


def read_map_directory(directory: Path) -> DirectoryMap:
    """Raises ``MapDirectoryError``."""
    description_path, overlays_path = directory / "map.yaml", directory / "overlays.geojson"
    description = _read_description(description_path)
    image_path = directory / str(description["image"])
    png, overlays_text = _read(image_path), _read(overlays_path) if overlays_path.exists() else b""
    fields: dict[str, Any] = {
        "map_name": str(description.get("name", directory.resolve().name)),
        "png": png,
        "origin": _origin(description, description_path),
        "resolution": _number(description, "resolution", description_path),
    }
    if overlays_text:
        fields["overlays"] = _parse_overlays(overlays_text, overlays_path)
    try:
        created = CreateMap(**fields)
        check_map(created)
        created = created.model_copy(update={"png": stored_png(created.png, _reading(description, description_path))})
        codec_for(CreateMap).dumps(created)  # an integer of any size is JSON, but cannot be encoded on the bus
    except ValidationError as error:
        raise MapDirectoryError(f"{directory}: {explain(error)}") from None
    except RequestRefused as refused:
        raise MapDirectoryError(f"{directory}: {refused.text}") from None
    except MalformedMessage as malformed:
        raise MapDirectoryError(f"{directory}: {malformed}") from None
    changed = max(int(p.stat().st_mtime) for p in (description_path, image_path, overlays_path) if p.exists())
    return DirectoryMap(created.model_copy(update={"uid": _content_uid(created)}), changed)


def floor_directories(directory: Path) -> list[Path]:
    """The folders in it that hold maps of further floors."""
    return sorted(path.parent for path in directory.glob("*/map.yaml"))


def _read_description(path: Path) -> dict[str, Any]:
    try:
        description = yaml.safe_load(_read(path))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise MapDirectoryError(f"{path}: not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(description, dict) or not isinstance(description.get("image"), str):
        raise MapDirectoryError(f"{path}: want at least the keys image, resolution and origin")
    return description


def _reading(description: dict[str, Any], path: Path) -> Reading:
    try:
        return Reading.of(description)
    except ValueError as error:
        raise MapDirectoryError(f"{path}: {error}") from None


def _origin(description: dict[str, Any], path: Path) -> tuple[float, float]:
    origin = description.get("origin")
    if not isinstance(origin, list) or len(origin) not in (2, 3) or not all(_is_number(v) for v in origin):
        raise MapDirectoryError(f"{path}: origin is {origin!r}, want [x, y, 0] of the lower-left corner in metres")
    if len(origin) == 3 and origin[2] != 0:
        raise MapDirectoryError(
            f"{path}: origin is rotated by {origin[2]} rad; maps with a rotated origin are not supported"
        )
    return float(origin[0]), float(origin[1])


def _number(description: dict[str, Any], key: str, path: Path) -> float:
    value = description.get(key)
    if not _is_number(value):
        raise MapDirectoryError(f"{path}: {key} is {value!r}, want a number")
    return float(value)  # type: ignore[arg-type]


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _parse_overlays(text: bytes, path: Path) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise MapDirectoryError(f"{path}: not JSON: {error}") from None


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise MapDirectoryError(f"{path}: {error.strerror}") from None


def _content_uid(created: CreateMap) -> str:
    rest = created.model_dump(exclude={"png", "uid"})
    return hashlib.sha256(created.png + json.dumps(rest, sort_keys=True).encode()).hexdigest()[:24]
