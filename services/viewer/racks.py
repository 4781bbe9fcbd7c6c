"""Racks as a chassis knows them: outline in force, the rack it carries or is under, what it detects, rack points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rackhand.schemas.base import Pose2
from rackhand.schemas.maps import MapData, PointType, overlay_code
from rackhand.schemas.planar import as_tuple, transform
from rackhand.schemas.racks import DetectedRack, LoadReport, Occupancy, RackStates, SeenRacks
from rackhand.services.viewer import colours
from rackhand.services.viewer.items import Drawing
from rackhand.services.viewer.shapes import ink, line, pen

Place = tuple[float, float, str]  # x, y, name
OUTLINE_Z, LEG_Z = 0.025, 0.18
STAGING_LENGTH = 0.5
STATES: Mapping[Occupancy, colours.Colour] = {
    "occupied": colours.OCCUPIED,
    "free": colours.FREE,
    "unknown": colours.AREA,
}


def outline_drawing(robot: str, frame: str, corners: NDArray[np.float64]) -> Drawing:
    """The outline (n, 2) that must not touch anything now, on the floor; ``frame`` is that of the chassis."""
    return Drawing(f"{robot}/outline", (_closed(corners, colours.FOOTPRINT),), frame=frame, lasting=True)


def load_drawings(robot: str, frame: str, load: LoadReport) -> Iterable[Drawing]:
    """The rack with its margins: in the frame of the chassis while it is carried, in the map while on the floor."""
    nothing: NDArray[np.float64] = np.empty((0, 2))
    outline = nothing
    if load.spec is not None and load.rack_pose is not None:
        outline = _at(load.rack_pose, load.spec.outline())
    carried = load.state == "carrying"
    parts = [_closed(outline if shown else nothing, colours.RACK, 3.0) for shown in (carried, not carried)]
    yield Drawing(f"{robot}/rack/carried", (parts[0],), frame=frame, lasting=True)
    yield Drawing(f"{robot}/rack/floor", (parts[1],), lasting=True)


def detected_drawings(robot: str, found: DetectedRack) -> Iterable[Drawing]:
    """Legs, the rectangle over their outer faces, and the staging pose; nothing where no rack was found."""
    outline: NDArray[np.float64] = np.empty((0, 2))
    if found.pose is not None:
        x, y = found.depth / 2, found.width / 2
        outline = _at(found.pose, np.array([(x, y), (-x, y), (-x, -y), (x, -y)]))
    legs = np.column_stack([found.legs, np.full(len(found.legs), LEG_Z)])
    yield Drawing(f"{robot}/rack/detected", (_closed(outline, colours.DETECTED),))
    yield Drawing(f"{robot}/rack/legs", (rr.Points3D(legs, colors=ink(colours.DETECTED), radii=pen(6.0)),))
    yield Drawing(f"{robot}/rack/staging", (_arrow(found.staging),))


def seen_drawing(robot: str, seen: SeenRacks) -> Drawing:
    """The racks on the floor with their margins, at their measured places."""
    outlines = [_ring(_at(rack.pose, rack.spec.outline())) for rack in seen.racks]
    lines = rr.LineStrips3D(outlines, colors=ink(colours.RACK), radii=pen(1.5))
    return Drawing(f"{robot}/rack/seen", (lines,), lasting=True)


def rack_points(data: MapData | None) -> dict[str, Place]:
    """The rack points of a map, by the ids of their features."""
    features = [] if data is None else data.overlays.get("features", [])
    return {
        str(feature.get("id", "")): (*feature["geometry"]["coordinates"][:2], str(properties.get("name") or ""))
        for feature in features
        if overlay_code((properties := feature.get("properties") or {}).get("type")) == PointType.RACK
        and (feature.get("geometry") or {}).get("type") == "Point"
    }


def states_drawing(robot: str, points: Mapping[str, Place], states: RackStates | None) -> Drawing:
    """A dot at each rack point in the colour of its state; points that nothing is known of are unknown."""
    known = {} if states is None else {row.poi_id: [level.state for level in row.levels] for row in states.racks}
    shades = [STATES[_state(known.get(point, []))] for point in points]
    places = [(x, y, OUTLINE_Z) for x, y, _ in points.values()]
    labels = [f"{name}: {_state(known.get(point, []))}" for point, (_, _, name) in points.items()]
    dots = rr.Points3D(places, colors=shades, radii=0.06, labels=labels or None, show_labels=False)
    return Drawing(f"{robot}/rack/points", (dots,), lasting=True)


def _state(levels: list[Occupancy]) -> Occupancy:
    """Of a rack point from those of its levels: a point is free if all of them are."""
    if "occupied" in levels:
        return "occupied"
    return "free" if levels and set(levels) == {"free"} else "unknown"


def _at(pose: Pose2, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners (n, 2) of the pose's frame in the frame that it is given in."""
    return np.array([transform(as_tuple(pose), x, y) for x, y in corners.tolist()])


def _closed(corners: NDArray[np.float64], colour: colours.Colour, width: float = 2.0) -> rr.LineStrips3D:
    return line(_ring(corners), colour, width)


def _ring(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners (n, 2) as a closed line just over the floor, (n + 1, 3)."""
    closed = np.vstack([corners, corners[:1]])
    return np.column_stack([closed, np.full(len(closed), OUTLINE_Z)])


def _arrow(pose: Pose2 | None) -> rr.Arrows3D:
    if pose is None:
        return rr.Arrows3D(vectors=[])
    vector = (STAGING_LENGTH * math.cos(pose.yaw), STAGING_LENGTH * math.sin(pose.yaw), 0.0)
    return rr.Arrows3D(
        origins=[(pose.x, pose.y, OUTLINE_Z)], vectors=[vector], colors=ink(colours.DETECTED), radii=0.03
    )
