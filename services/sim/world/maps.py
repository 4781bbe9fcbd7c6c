"""The map of a world: its static geometry, cut in the plane of the lidar, as a ROS-style PNG and YAML."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

from rackhand.worlds.solids import Shape, charger_shapes, static_shapes
from rackhand.worlds.world_model import MAIN_FLOOR, World

OCCUPIED, UNKNOWN, FREE = 0, 205, 254


def map_shapes(world: World) -> list[Shape]:
    """What the map shows: mapped statics and chargers where the plane cuts them; no racks, people or crates."""
    shapes = [shape for static in world.statics.values() if static.mapped for shape in static_shapes(static)]
    shapes += [shape for charger in world.chargers.values() for shape in charger_shapes(charger)]
    return [shape for shape in shapes if shape.cuts(world.map.height)]


def map_origin(world: World, floor: str = MAIN_FLOOR) -> tuple[float, float]:
    """The lower-left corner."""
    bounds = world.bounds_of_floors[floor]
    return round(bounds[0] - world.map.margin, 6), round(bounds[1] - world.map.margin, 6)


def draw(world: World, floor: str = MAIN_FLOOR) -> NDArray[np.uint8]:
    """The map of a floor, rows from the top (highest y) down: occupied where a shape covers any of a cell's nine probe
    points, free on the rest of the floor, unknown round it.
    """
    resolution, margin = world.map.resolution, world.map.margin
    x_min, y_min, x_max, y_max = world.bounds_of_floors[floor]
    columns = round((x_max - x_min + 2 * margin) / resolution)
    rows = round((y_max - y_min + 2 * margin) / resolution)
    left, bottom = map_origin(world, floor)
    x = left + (np.arange(columns) + 0.5) * resolution
    y = bottom + (np.arange(rows) + 0.5) * resolution
    xs, ys = np.meshgrid(x, y)
    on_floor = (xs > x_min) & (xs < x_max) & (ys > y_min) & (ys < y_max)
    grid = np.where(on_floor, FREE, UNKNOWN).astype(np.uint8)
    grid[_covered(map_shapes(world), xs, ys, resolution)] = OCCUPIED
    return grid[::-1]


def _covered(
    shapes: Iterable[Shape], xs: NDArray[np.float64], ys: NDArray[np.float64], resolution: float
) -> NDArray[np.bool_]:
    covered = np.zeros(xs.shape, dtype=bool)
    # Just inside the cell, so that a shape whose face lies on a cell border does not fill the cell beyond it too.
    probe = 0.499 * resolution
    offsets = [(dx, dy) for dx in (-probe, 0.0, probe) for dy in (-probe, 0.0, probe)]
    for shape in shapes:
        reach = math.hypot(shape.a, shape.b) + resolution
        near = (np.abs(xs - shape.x) < reach) & (np.abs(ys - shape.y) < reach)
        for dx, dy in offsets:
            covered[near] |= _inside(shape, xs[near] + dx, ys[near] + dy)
    return covered


def _inside(shape: Shape, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.bool_]:
    dx, dy = x - shape.x, y - shape.y
    if shape.kind == "cylinder":
        return np.asarray(np.hypot(dx, dy) < shape.a)
    c, s = math.cos(shape.yaw), math.sin(shape.yaw)
    return np.asarray((np.abs(c * dx + s * dy) < shape.a) & (np.abs(c * dy - s * dx) < shape.b))


def png(grid: NDArray[np.uint8]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(grid).save(buffer, format="PNG", optimize=True)
    return buffer.getvalue()


def description(world: World, floor: str = MAIN_FLOOR) -> dict[str, Any]:
    """What ``map.yaml`` says, as ROS's map_server reads it."""
    return {
        "image": "map.png",
        "name": world.map_name(floor),
        "resolution": world.map.resolution,
        "origin": [*map_origin(world, floor), 0.0],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
    }


def floor_folder(folder: Path, floor: str) -> Path:
    """Where the map of a floor is in the folder of its world."""
    return folder if floor == MAIN_FLOOR else folder / floor


def write_map(world: World, folder: Path) -> tuple[Path, ...]:
    """Write ``map.png`` and ``map.yaml`` of each floor: into the folder, and of further floors into a folder of their
    name in it. Raises ``OSError``.
    """
    written = []
    for floor in world.bounds_of_floors:
        place = floor_folder(folder, floor)
        place.mkdir(parents=True, exist_ok=True)
        image, text = place / "map.png", place / "map.yaml"
        image.write_bytes(png(draw(world, floor)))
        text.write_text(yaml.safe_dump(description(world, floor), sort_keys=False))
        written += [image, text]
    return tuple(written)
