"""Recordings, read back."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rerun.chunk import Chunk, RrdReader

Pose = tuple[tuple[float, ...], tuple[float, ...]]  # position, quaternion w, x, y, z


def chunks(file: Path) -> Iterator[Chunk]:
    yield from RrdReader(str(file)).stream()


def entities(file: Path) -> set[str]:
    """Every entity that holds something, without its leading slash."""
    return {chunk.entity_path.removeprefix("/") for chunk in chunks(file) if chunk.num_rows}


def end(file: Path) -> int | None:
    """The last moment in it, in ns; none where nothing in it has a time."""
    moments = [chunk.to_record_batch()["sim_time"].cast("int64") for chunk in chunks(file) if not chunk.is_static]
    return max((stamp for column in moments for stamp in column.to_pylist()), default=None)


def stamps(file: Path, entity: str) -> list[int]:
    """When an entity was drawn."""
    return sorted(
        stamp
        for chunk in chunks(file)
        if chunk.entity_path == f"/{entity}" and not chunk.is_static
        for stamp in chunk.to_record_batch()["sim_time"].cast("int64").to_pylist()
    )


def column(file: Path, entity: str, name: str) -> list[Any]:
    """The values of one component of an entity, as in ``TextLog:text``: a list each time that it was drawn."""
    batches = [chunk.to_record_batch() for chunk in chunks(file) if chunk.entity_path == f"/{entity}"]
    return [value for batch in batches if name in batch.schema.names for value in batch[name].to_pylist()]


def passing(file: Path) -> set[str]:
    """The chunks that have a time, by their ids: what a server may forget."""
    return {chunk.id for chunk in chunks(file) if not chunk.is_static}


def poses(file: Path) -> dict[tuple[int, str], Pose]:
    """(stamp, frame) → where it is in its parent."""
    found: dict[tuple[int, str], Pose] = {}
    for chunk in chunks(file):
        if chunk.entity_path != "/tf":
            continue
        batch = chunk.to_record_batch()
        stamps = batch["sim_time"].cast("int64").to_pylist()
        names = batch["Transform3D:child_frame"].to_pylist()
        positions, turns = batch["Transform3D:translation"].to_pylist(), batch["Transform3D:quaternion"].to_pylist()
        for stamp, [name], [position], [turn] in zip(stamps, names, positions, turns, strict=True):
            found[stamp, name] = tuple(position), (turn[3], *turn[:3])
    return found


def newest(file: Path) -> dict[str, Pose]:
    """Frame → where it was last."""
    latest: dict[str, tuple[int, Pose]] = {}
    for (stamp, frame), pose in poses(file).items():
        if frame not in latest or stamp >= latest[frame][0]:
            latest[frame] = stamp, pose
    return {frame: pose for frame, (_, pose) in latest.items()}


def apart(one: Pose, other: Pose) -> float:
    """The larger of the differences of any coordinate; a quaternion and its negative are one rotation."""
    (here, turn), (there, other_turn) = ([np.array(part) for part in pose] for pose in (one, other))
    turned = min(np.abs(turn - other_turn).max(), np.abs(turn + other_turn).max())
    return float(max(np.abs(here - there).max(), turned))
