"""What stands where: names and clearances of the things that keep a footprint from a place."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.explain import Thing, ThingKind
from rackhand.schemas.maps import LineType, RegionType
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint, expanded
from rackhand.services.planner.geometry.polygon import inside_convex
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.map.grid import StaticMap
from rackhand.services.planner.perception.local_costmap import LocalCostmap

Array = NDArray[np.float64]
NEAR = 0.5  # m from the body within which a thing is looked for
AHEAD = 3.0  # m of path that are looked at
MOST_POSES = 200  # of a path that are looked at


def kind_at(costmap: LocalCostmap, x: float, y: float) -> tuple[ThingKind, str]:
    """What is in the cell of a point, and its name where it has one."""
    point = np.array([[x, y]])
    for mover in costmap.movers.moving:
        if math.hypot(*(mover.position - point[0])) <= mover.radius:
            return "moving obstacle", ""
    mapped = mapped_kind_at(costmap.static, x, y)
    if mapped is not None:
        return mapped
    margin = costmap.static.geometry.resolution
    for rack in costmap.racks.blocking:
        if inside_convex(expanded(rack.outline, margin), point)[0]:
            return "rack", f"{rack.spec.width:.2f} m wide, {rack.spec.depth:.2f} m deep"
    return "observed obstacle", ""


def mapped_kind_at(static: StaticMap, x: float, y: float) -> tuple[ThingKind, str] | None:
    """What the map and its overlays have in the cell of a point; None for free ground."""
    g = static.geometry
    if not g.contains(x, y):
        return "edge of the map", ""
    cell = g.cell(x, y)
    if static.occupied[cell]:
        return "mapped obstacle", ""
    if not static.blocked[cell]:
        return None
    for zone in static.overlays.zones_of(RegionType.NO_GO):
        if zone.contains(x, y) or any(_beside(ring, x, y, g.resolution) for ring in zone.rings):
            return "no-go zone", zone.name or zone.id
    for wall in static.overlays.lines_of(LineType.VIRTUAL_WALL):
        if _beside(wall.points, x, y, g.resolution):
            return "virtual wall", wall.name or wall.id
    return "unknown ground", ""


def thing_at(costmap: LocalCostmap, x: float, y: float) -> Thing:
    """The thing in the cell of a point, as one that blocks."""
    kind, name = kind_at(costmap, x, y)
    return Thing(role="blocks", kind=kind, name=name, x=round(x, 3), y=round(y, 3))


def mapped_at(costmap: LocalCostmap, footprint: Footprint, pose: Pose, needed: float = 0.0) -> Thing | None:
    """What the map has nearest to the footprint at a pose; None where it has nothing near."""
    cells = _cells_around(costmap.static.blocked, True, costmap.static.geometry, pose, footprint.circumscribed + NEAR)
    return _nearest(costmap, footprint, pose, cells, needed)


def nearest_at(costmap: LocalCostmap, footprint: Footprint, pose: Pose, needed: float = 0.0) -> Thing | None:
    """What stands or moves nearest to the footprint at a pose near the chassis; None where nothing is near."""
    near = costmap.near
    standing = _cells_around(near.distance, 0.0, near.geometry, pose, footprint.circumscribed + NEAR)
    nearest = _nearest(costmap, footprint, pose, standing, needed)
    for mover in costmap.movers.moving:
        clearance = float(_to_body(footprint, pose, mover.position[None])[0]) - mover.radius
        if clearance < NEAR and (nearest is None or nearest.clearance is None or clearance < nearest.clearance):
            nearest = _thing("moving obstacle", "", mover.position, clearance, needed, pose)
    return nearest


def on_path(costmap: LocalCostmap, footprint: Footprint, path: Array, needed: float) -> Thing | None:
    """The first thing that leaves less than ``needed`` metres beside a path, rows x, y, yaw; None where none does."""
    travelled = 0.0
    for k, pose in enumerate(path[:MOST_POSES]):
        travelled += math.hypot(*(pose[:2] - path[k - 1, :2])) if k else 0.0
        if travelled > AHEAD:
            return None
        if costmap.near.clearance(footprint, pose, needed) < needed or _is_moved_into(costmap, footprint, pose, needed):
            thing = nearest_at(costmap, footprint, pose, needed)
            if thing is not None and thing.clearance is not None and thing.clearance < needed:
                return thing
    return None


def beside_turn(costmap: LocalCostmap, footprint: Footprint, pose: Pose) -> Thing | None:
    """What stands inside the circle that the footprint sweeps in a turn on the spot, the nearest to its middle; the
    clearance is to that circle. None where the circle is free."""
    near = costmap.near
    cells = _cells_around(near.distance, 0.0, near.geometry, pose, footprint.circumscribed)
    if not len(cells):
        return None
    away = np.hypot(*(cells - pose[:2]).T)
    k = int(away.argmin())
    clearance = float(away[k]) - 0.5 * near.geometry.resolution - footprint.circumscribed
    if clearance >= 0.0:
        return None
    return _thing(*kind_at(costmap, *cells[k].tolist()), cells[k], clearance, 0.0, pose)


def _is_moved_into(costmap: LocalCostmap, footprint: Footprint, pose: Pose, needed: float) -> bool:
    return any(
        _to_body(footprint, pose, mover.position[None])[0] - mover.radius < needed for mover in costmap.movers.moving
    )


def _nearest(costmap: LocalCostmap, footprint: Footprint, pose: Pose, cells: Array, needed: float) -> Thing | None:
    if not len(cells):
        return None
    away = _to_body(footprint, pose, cells)
    k = int(away.argmin())
    clearance = float(away[k]) - 0.5 * costmap.static.geometry.resolution
    if clearance > NEAR:
        return None
    return _thing(*kind_at(costmap, *cells[k].tolist()), cells[k], clearance, needed, pose)


def _thing(kind: ThingKind, name: str, at: Array, clearance: float, needed: float, pose: Pose) -> Thing:
    return Thing(
        role="blocks",
        kind=kind,
        name=name,
        x=round(float(at[0]), 3),
        y=round(float(at[1]), 3),
        clearance=round(clearance, 3),
        needed=round(needed, 3),
        at=se2.message(pose),
    )


def _to_body(footprint: Footprint, pose: Pose, points: Array) -> Array:
    """``distance_to_body`` of each point (n, 2)."""
    local = se2.transformed(se2.between(pose, np.zeros(3)), points)
    distances: Array = (local @ footprint.edges[:, :2].T - footprint.edges[:, 2]).max(axis=1)
    return distances


def _cells_around(field: NDArray[Any], blocked: float, g: Geometry, pose: Pose, reach: float) -> Array:
    """Centres of the cells in a square about a pose in which the field has the value ``blocked``, (n, 2)."""
    rows, columns = g.window((pose[0] - reach, pose[1] - reach), (pose[0] + reach, pose[1] + reach))
    found_rows, found_columns = np.nonzero(field[rows, columns] == blocked)
    return g.centres((found_rows + rows.start) * g.columns + found_columns + columns.start)


def _beside(line: Array, x: float, y: float, reach: float) -> bool:
    """Whether a point lies within ``reach`` metres of a polyline (n, 2)."""
    start, way = line[:-1], np.diff(line, axis=0)
    to_point = np.array([x, y]) - start
    squared = np.maximum((way * way).sum(axis=1), 1e-12)
    share = np.clip((to_point * way).sum(axis=1) / squared, 0.0, 1.0)
    return bool((np.hypot(*(to_point - share[:, None] * way).T) <= reach).any())
