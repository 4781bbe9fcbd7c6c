"""Geometry that came as data, as shapes to draw: one entity a body and kind of shape."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rackhand.schemas.world import Scene, SceneGeom
from rackhand.services.viewer.items import MAP, Drawing

STILL_BODY = "world"  # of the scene: static objects
FLOOR_MARGIN = 0.5  # m that an endless floor is drawn beyond everything on it
FLOOR_THICKNESS = 0.02
HALL_GAP = 8.0  # m without anything static, along x or y, between one hall and the next: the floors of a building

Archetype = rr.AsComponents
Bounds = NDArray[np.float64]
Group = tuple[str, str]  # body, kind of shape
EMPTY_HALL = ((-5.0, -5.0, 0.0), (5.0, 5.0, 1.0))  # where nothing static says how large it is


def grouped(scene: Scene) -> dict[Group, tuple[SceneGeom, ...]]:
    """The geometry by body and kind of shape. An endless floor becomes a slab for each hall."""
    groups: dict[Group, list[SceneGeom]] = defaultdict(list)
    for geom in scene.geoms:
        for shown in _slabs(scene, geom) if geom.shape == "plane" else (geom,):
            groups[shown.body, shown.shape].append(shown)
    return {group: tuple(geoms) for group, geoms in groups.items()}


def is_same(one: Sequence[SceneGeom], other: Sequence[SceneGeom] | None) -> bool:
    return other is not None and [g.model_dump_json() for g in one] == [g.model_dump_json() for g in other]


def draw(group: Group, geoms: Sequence[SceneGeom]) -> Drawing:
    body, shape = group
    frame = MAP if body == STILL_BODY else body
    return Drawing(f"scene/{body}/{shape}", (_SHAPES[shape](geoms),), frame=frame, static=True)


def halls(scene: Scene) -> list[Bounds]:
    """Lowest and highest corner (2, 3) of the static objects of each hall, but for the floor; fullest hall first."""
    still = [geom for geom in scene.geoms if geom.body == STILL_BODY and geom.shape != "plane"]
    if not still:
        return []
    corners = np.array([_corners(geom) for geom in still])
    groups = [group for along_x in _split(corners, 0) for group in _split(along_x, 1)]
    groups.sort(key=len, reverse=True)
    return [np.array([group[:, 0].min(axis=0), group[:, 1].max(axis=0)]) for group in groups]


def _split(corners: NDArray[np.float64], axis: int) -> list[NDArray[np.float64]]:
    """The boxes (n, 2, 3) in parts, where nothing is for ``HALL_GAP`` along the axis."""
    ordered = corners[np.argsort(corners[:, 0, axis])]
    ends = np.maximum.accumulate(ordered[:, 1, axis])
    return np.split(ordered, np.nonzero(ordered[1:, 0, axis] - ends[:-1] > HALL_GAP)[0] + 1)


def rotation_matrices(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3, 3) of unit quaternions (n, 4) w, x, y, z."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)


def _corners(geom: SceneGeom) -> Bounds:
    """The box along the axes around a shape."""
    half = np.array(_half_extent(geom))
    reach = np.abs(rotation_matrices(np.array([geom.orientation]))[0]) @ half
    return np.array([geom.position - reach, geom.position + reach])


def _half_extent(geom: SceneGeom) -> tuple[float, float, float]:
    first, second, _ = geom.size
    match geom.shape:
        case "sphere":
            return first, first, first
        case "cylinder":
            return first, first, second
        case "capsule":
            return first, first, first + second
        case _:
            return geom.size


def _slabs(scene: Scene, plane: SceneGeom) -> list[SceneGeom]:
    """Slabs whose tops are the plane z = 0, under all static objects."""
    return [_slab(bounds, plane) for bounds in halls(scene) or [np.array(EMPTY_HALL)]]


def _slab(bounds: Bounds, plane: SceneGeom) -> SceneGeom:
    low, high = bounds
    middle, half = (low + high) / 2, (high - low) / 2 + FLOOR_MARGIN
    return SceneGeom(
        body=STILL_BODY,
        shape="box",
        size=(half[0], half[1], FLOOR_THICKNESS / 2),
        position=(middle[0], middle[1], -FLOOR_THICKNESS / 2),
        orientation=(1.0, 0.0, 0.0, 0.0),
        rgba=plane.rgba,
    )


# -- shapes: MuJoCo's conventions (half-lengths, centres) to Rerun's ---------------------------------------------------


def _boxes(geoms: Sequence[SceneGeom]) -> Archetype:
    return rr.Boxes3D(
        half_sizes=_column(geoms, lambda g: g.size),
        centers=_positions(geoms),
        quaternions=quaternions_xyzw(g.orientation for g in geoms),
        colors=_colours(geoms),
        fill_mode="solid",
    )


def _cylinders(geoms: Sequence[SceneGeom]) -> Archetype:
    return rr.Cylinders3D(
        lengths=[2 * g.size[1] for g in geoms],
        radii=[g.size[0] for g in geoms],
        centers=_positions(geoms),
        quaternions=quaternions_xyzw(g.orientation for g in geoms),
        colors=_colours(geoms),
        fill_mode="solid",
    )


def _capsules(geoms: Sequence[SceneGeom]) -> Archetype:
    """Rerun's capsules begin at their origin; the simulator's have it in their middle."""
    halves = np.array([[0.0, 0.0, g.size[1]] for g in geoms]).reshape(-1, 3)
    turned = rotation_matrices(np.array([g.orientation for g in geoms]).reshape(-1, 4)) @ halves[..., None]
    return rr.Capsules3D(
        lengths=[2 * g.size[1] for g in geoms],
        radii=[g.size[0] for g in geoms],
        translations=_positions(geoms) - turned[..., 0],
        quaternions=quaternions_xyzw(g.orientation for g in geoms),
        colors=_colours(geoms),
        fill_mode="solid",
    )


def _ellipsoids(geoms: Sequence[SceneGeom]) -> Archetype:
    return rr.Ellipsoids3D(
        half_sizes=_column(geoms, _half_extent),
        centers=_positions(geoms),
        quaternions=quaternions_xyzw(g.orientation for g in geoms),
        colors=_colours(geoms),
        fill_mode="solid",
    )


# A mesh comes without its vertices: its box is drawn instead.
_SHAPES: dict[str, Callable[[Sequence[SceneGeom]], Archetype]] = {
    "box": _boxes,
    "mesh": _boxes,
    "cylinder": _cylinders,
    "capsule": _capsules,
    "sphere": _ellipsoids,
    "ellipsoid": _ellipsoids,
}


def quaternions_xyzw(quaternions: Iterable[Sequence[float]]) -> NDArray[np.float64]:
    """(n, 4) as Rerun has them, from w, x, y, z."""
    return np.roll(np.array(list(quaternions), dtype=np.float64).reshape(-1, 4), -1, axis=1)


def _column(geoms: Sequence[SceneGeom], of: Callable[[SceneGeom], Sequence[float]]) -> NDArray[np.float64]:
    return np.array([of(geom) for geom in geoms], dtype=np.float64).reshape(-1, 3)


def _positions(geoms: Sequence[SceneGeom]) -> NDArray[np.float64]:
    return _column(geoms, lambda g: g.position)


def _colours(geoms: Sequence[SceneGeom]) -> NDArray[np.uint8]:
    return np.round(np.array([g.rgba for g in geoms]).reshape(-1, 4) * 255).astype(np.uint8)
