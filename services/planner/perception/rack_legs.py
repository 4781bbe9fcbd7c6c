"""Racks in a scan: four legs at the corners of a rectangle, of the size of a kind of rack that is known.

Small clusters that form a rectangle are candidates; the pose of one that has the right size is refined by comparing,
leg by leg, its range and its bearing with those that the visible faces of a leg there would have. Range noise does not
bias that, while the distance of hits to a leg's outline does: noise puts some of them inside it.

All poses here are in the frame of the scan's points; a rack's frame is that of ``rackhand.schemas.racks.RackSpec``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.explain import Measure, Role, Thing, ThingKind
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.se2 import Pose, wrap
from rackhand.services.planner.perception.clusters import Clusters, small_clusters
from rackhand.services.planner.perception.leg_fit import LegFit, fit_legs
from rackhand.services.planner.perception.miss import Miss

Array = NDArray[np.float64]

SIZE_TOLERANCE = 0.05  # m by which width and depth may differ from those of a kind
SHAPE_TOLERANCE = 0.06  # m by which the sides of a rectangle of clusters may differ, and its diagonals
SHORTEST, LONGEST = 0.35, 2.5  # m between the legs of a rack
SEARCH_RADIUS, SEARCH_YAW = 0.5, math.radians(30)  # off the prior pose within which a rack is taken for the one meant
WORST_RMS = 0.03  # m of residual of a fit from which on it is no rack
HIDDEN_BY = 0.08  # m by which a hit must be nearer than a leg to hide it
CORNERS = np.array([(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)])  # signs, in the order of ``legs``


class RackSighting(NamedTuple):
    """One rack in one scan. ``width`` and ``depth`` as measured, in metres. ``legs``: middles of the legs that were
    seen, (n, 2). ``rms``: residual of the fit in metres; ``hits``: of the legs."""

    pose: Pose
    spec: RackSpec
    width: float
    depth: float
    legs: Array
    hits: int
    rms: float

    def moved(self, frame: Pose) -> RackSighting:
        """This sighting, which is given in the frame of ``frame``, in its parent frame."""
        return self._replace(pose=se2.compose(frame, self.pose), legs=se2.transformed(frame, self.legs))


class Rectangle(NamedTuple):
    """Clusters in a rectangle: its middle and the heading of its depth, and the clusters at its corners, front left
    first and counter-clockwise; -1 where a corner is hidden. Sizes between the middles of clusters."""

    pose: Pose
    depth: float
    width: float
    corners: tuple[int, int, int, int]


def find_rack(points: Array, sensor: Array, prior: Pose, specs: Sequence[RackSpec]) -> RackSighting | None:
    """The rack near ``prior`` that fits one of ``specs``; the better fit where several do.

    ``points``: (n, 2) in the order of the beams; ``sensor``: the lidar's position. Three legs suffice where something
    nearer hides the fourth.
    """
    near = _near(small_clusters(points, sensor), prior, specs)
    fits = _fits(near, sensor, _candidates(_rectangles(near), prior), specs)
    fits = fits or _fits(near, sensor, _candidates(_rectangles_of_three(near, points, sensor), prior), specs)
    return min(fits, key=_misfit, default=None)


def find_racks(points: Array, sensor: Array, specs: Sequence[RackSpec]) -> list[RackSighting]:
    """All racks in a scan that show four legs, wherever they are; no leg belongs to two of them. Their headings are
    known but for half a turn, or a quarter of one if they are square."""
    clusters = small_clusters(points, sensor)
    both = [turned for found in _rectangles(clusters) for turned in (found, _turned(found, 1))]
    taken: list[RackSighting] = []
    for fit in sorted(_fits(clusters, sensor, both, specs), key=_misfit):
        if not any(_share_a_leg(fit, other) for other in taken):
            taken.append(fit)
    return taken


def measure_racks(points: Array, sensor: Array, leg_size: float) -> list[RackSighting]:
    """All racks in a scan that show four legs, of whatever size; ``leg_size`` is that of a leg in metres. No leg
    belongs to two of them: the better rectangle has it."""
    clusters = small_clusters(points, sensor)
    sizes = [
        (found, RackSpec(width=found.width + leg_size, depth=found.depth + leg_size, leg_size=leg_size))
        for found in _rectangles(clusters)
    ]
    fits = [fit for found, size in sizes if (fit := _as_kind(clusters, sensor, found, size)) is not None]
    taken: list[RackSighting] = []
    for fit in sorted(fits, key=lambda fit: fit.rms):
        if not any(_share_a_leg(fit, other) for other in taken):
            taken.append(fit)
    return taken


def describe_miss(points: Array, sensor: Array, prior: Pose, specs: Sequence[RackSpec]) -> Miss:
    """What is near ``prior`` instead of a rack of ``specs``, in the words of the real robot where it has some."""
    near = _near(small_clusters(points, sensor), prior, specs)
    others = _candidates(_rectangles(near) + _rectangles_of_three(near, points, sensor), prior)
    if others:
        leg = specs[0].leg_size if specs else 0.0
        seen = min(others, key=lambda found: math.hypot(*(found.pose[:2] - prior[:2])))
        wanted = " or ".join(f"configed({spec.width:.3f},{spec.depth:.3f})" for spec in specs)
        text = f"Wrong rack size: detected({seen.width + leg:.3f},{seen.depth + leg:.3f}), {wanted or 'none configed'}"
        return Miss(text, (_thing("seen", "rack", seen.pose),), _sizes(seen.width + leg, seen.depth + leg, specs))
    missing = _missing_legs(near, prior, specs)
    place = f"within {SEARCH_RADIUS:.2f} m of ({prior[0]:.2f}, {prior[1]:.2f})"
    legs = (Measure(name="legs seen", value=4 - len(missing), expected=4),)
    if len(missing) < 4:
        text = f"failed to find rack: {4 - len(missing)} of 4 legs detected {place}"
        return Miss(text, tuple(_thing("expected", "rack leg", leg) for leg in missing), legs)
    text = f"failed to find rack: no legs in a rectangle detected {place}"
    return Miss(text, (_thing("expected", "rack", prior),), legs)


def leg_middles(spec: RackSpec) -> Array:
    """Middles of the legs in the rack's frame, (4, 2), front left first and counter-clockwise."""
    half = 0.5 * np.array([spec.depth - spec.leg_size, spec.width - spec.leg_size])
    middles: Array = CORNERS * half
    return middles


# -- rectangles --------------------------------------------------------------------------------------------------------


def _near(clusters: Clusters, prior: Pose, specs: Iterable[RackSpec]) -> Clusters:
    """Clusters that can be legs of a rack there."""
    reach = SEARCH_RADIUS + max((0.5 * math.hypot(s.depth, s.width) for s in specs), default=0.0) + SIZE_TOLERANCE
    away = np.hypot(*(clusters.middles - prior[:2]).T)
    return clusters.at(np.nonzero(away <= reach)[0])


def _candidates(found: Iterable[Rectangle], prior: Pose) -> list[Rectangle]:
    """Those near the prior pose, their depth along its heading."""
    towards = [_towards(rectangle, prior) for rectangle in found]
    return [r for r in towards if _is_near(r.pose, prior)]


def _is_near(pose: Pose, prior: Pose) -> bool:
    away = math.hypot(pose[0] - prior[0], pose[1] - prior[1])
    return away <= SEARCH_RADIUS and abs(wrap(pose[2] - prior[2])) <= SEARCH_YAW


def _rectangles(clusters: Clusters) -> list[Rectangle]:
    """Two diagonals of one length with one middle make a rectangle."""
    middles = clusters.middles
    i, j = np.triu_indices(clusters.number, 1)
    lengths = np.hypot(*(middles[i] - middles[j]).T)
    fitting = (lengths >= SHORTEST * math.sqrt(2.0)) & (lengths <= LONGEST * math.sqrt(2.0))
    i, j, lengths = i[fitting], j[fitting], lengths[fitting]
    centres = 0.5 * (middles[i] + middles[j])
    a, b = np.triu_indices(len(lengths), 1)
    same = np.abs(lengths[a] - lengths[b]) <= SHAPE_TOLERANCE
    a, b = a[same], b[same]
    same = np.hypot(*(centres[a] - centres[b]).T) <= SHAPE_TOLERANCE
    found = [_rectangle(middles, (i[p], i[q], j[p], j[q])) for p, q in zip(a[same], b[same], strict=True)]
    return [r for r in found if min(r.depth, r.width) >= SHORTEST and max(r.depth, r.width) <= LONGEST]


def _rectangle(middles: Array, around: tuple[int, int, int, int]) -> Rectangle:
    """Of the clusters in this order around it, or the other way round."""
    p, q, r, s = (middles[k] for k in around)
    along = (p - q) + (s - r)
    across = (p - s) + (q - r)
    if along[0] * across[1] - along[1] * across[0] < 0.0:
        along, across, around = across, along, (around[0], around[3], around[2], around[1])
    yaw = math.atan2(along[1], along[0])
    centre = 0.25 * (p + q + r + s)
    corners = (int(around[0]), int(around[1]), int(around[2]), int(around[3]))
    return Rectangle(np.array([*centre, yaw]), 0.5 * math.hypot(*along), 0.5 * math.hypot(*across), corners)


def _rectangles_of_three(clusters: Clusters, points: Array, sensor: Array) -> list[Rectangle]:
    """A right angle of three clusters whose fourth corner is hidden behind something nearer."""
    middles, found = clusters.middles, []
    for corner in range(clusters.number):
        sides = middles - middles[corner]
        lengths = np.hypot(*sides.T)
        ends = np.nonzero((lengths >= SHORTEST) & (lengths <= LONGEST))[0]
        for left in ends:
            for right in ends:
                turn = sides[left][0] * sides[right][1] - sides[left][1] * sides[right][0]
                slant = abs(float(sides[left] @ sides[right])) / max(lengths[left], lengths[right])
                if turn <= 0.0 or slant > SHAPE_TOLERANCE:
                    continue
                fourth = middles[left] + sides[right]
                if _is_hidden(fourth, points, sensor):
                    found.append(_of_three(middles, (int(left), corner, int(right)), fourth))
    return found


def _of_three(middles: Array, seen: tuple[int, int, int], fourth: Array) -> Rectangle:
    """``seen``: front left, back left, back right, about a heading that may be a quarter turn off."""
    whole = _rectangle(np.vstack([middles[list(seen)], fourth]), (0, 1, 2, 3))
    corners = tuple(seen[k] if k < 3 else -1 for k in whole.corners)
    return whole._replace(corners=corners)  # type: ignore[arg-type]


def _is_hidden(place: Array, points: Array, sensor: Array) -> bool:
    """Whether a hit in the line of sight is nearer than a leg at ``place``."""
    away, seen = place - sensor[:2], points - sensor[:2]
    distance = math.hypot(*away)
    along, aside = seen @ away / distance, np.abs(seen @ np.array([-away[1], away[0]])) / distance
    in_line = (along > 0.0) & (aside * distance <= 0.5 * SIZE_TOLERANCE * along)
    return bool((along[in_line] < distance - HIDDEN_BY).any())


def _towards(found: Rectangle, prior: Pose) -> Rectangle:
    """The same rectangle with its depth as nearly along the heading of ``prior`` as can be."""
    quarters = round(wrap(prior[2] - found.pose[2]) / (math.pi / 2)) % 4
    return _turned(found, quarters)


def _turned(found: Rectangle, quarters: int) -> Rectangle:
    """The same rectangle, its heading turned to the left by so many quarters of a turn."""
    pose = np.array([found.pose[0], found.pose[1], wrap(found.pose[2] + quarters * math.pi / 2)])
    sizes = (found.depth, found.width) if quarters % 2 == 0 else (found.width, found.depth)
    # What was front left is front right after a quarter turn to the left, so the corners move on by one.
    p = found.corners
    corners = (p[quarters % 4], p[(quarters + 1) % 4], p[(quarters + 2) % 4], p[(quarters + 3) % 4])
    return Rectangle(pose, *sizes, corners)


# -- kinds -------------------------------------------------------------------------------------------------------------


def _fits(
    clusters: Clusters, sensor: Array, rectangles: Sequence[Rectangle], specs: Sequence[RackSpec]
) -> list[RackSighting]:
    """Each rectangle as each kind that it can be."""
    fits = []
    for found in rectangles:
        for spec in specs:
            rough = SIZE_TOLERANCE + spec.leg_size
            if abs(found.depth + spec.leg_size - spec.depth) > rough:
                continue
            if abs(found.width + spec.leg_size - spec.width) > rough:
                continue
            if (sighting := _as_kind(clusters, sensor, found, spec)) is not None:
                fits.append(sighting)
    return fits


def _as_kind(clusters: Clusters, sensor: Array, found: Rectangle, spec: RackSpec) -> RackSighting | None:
    seen = np.array([k for k, cluster in enumerate(found.corners) if cluster >= 0])
    legs = clusters.at(np.array([found.corners[k] for k in seen]))
    fit = fit_legs(legs, sensor, leg_middles(spec)[seen], spec, found.pose)
    depth, width = _size(fit, seen, spec)
    if fit.rms > WORST_RMS or max(abs(depth - spec.depth), abs(width - spec.width)) > SIZE_TOLERANCE:
        return None
    return RackSighting(fit.pose, spec, width, depth, fit.legs, int(legs.counts.sum()), fit.rms)


def _size(fit: LegFit, seen: NDArray[np.int64], spec: RackSpec) -> tuple[float, float]:
    """Depth and width over the outer faces of the legs, as measured."""
    own = (fit.legs - fit.pose[:2]) @ np.array(
        [(math.cos(fit.pose[2]), -math.sin(fit.pose[2])), (math.sin(fit.pose[2]), math.cos(fit.pose[2]))]
    )
    signs = CORNERS[seen]
    spans = [own[signs[:, axis] > 0, axis].mean() - own[signs[:, axis] < 0, axis].mean() for axis in (0, 1)]
    return float(spans[0]) + spec.leg_size, float(spans[1]) + spec.leg_size


def _misfit(fit: RackSighting) -> float:
    return abs(fit.width - fit.spec.width) + abs(fit.depth - fit.spec.depth) + fit.rms


def _share_a_leg(a: RackSighting, b: RackSighting) -> bool:
    away = np.hypot(*(a.legs[:, None] - b.legs[None]).transpose(2, 0, 1))
    return bool((away < 2.0 * SIZE_TOLERANCE).any())


def _missing_legs(near: Clusters, prior: Pose, specs: Sequence[RackSpec]) -> Array:
    """Where legs are not seen of the rack near the prior pose that shows the most, 2 or 3: (n, 2); of several such
    racks the one nearest to it. All four legs of a rack at the prior pose where none shows two."""
    best, missing = (1, 0.0), np.zeros((4, 2))
    for spec in specs:
        legs = se2.transformed(np.array([0.0, 0.0, prior[2]]), leg_middles(spec))
        for cluster in near.middles:
            for leg in legs:
                shift = cluster - leg
                off = math.hypot(*(shift - prior[:2]))
                if off > SEARCH_RADIUS:
                    continue
                away = np.hypot(*((legs + shift)[:, None] - near.middles[None]).transpose(2, 0, 1))
                seen = away.min(axis=1) <= 2.0 * SIZE_TOLERANCE
                if (found := (int(seen.sum()), -off)) > best and found[0] > 1:
                    best, missing = found, (legs + shift)[~seen]
    return missing


def _sizes(width: float, depth: float, specs: Sequence[RackSpec]) -> tuple[Measure, ...]:
    """What was measured, beside the kind of rack that it is most like."""
    like = min(specs, key=lambda spec: abs(spec.width - width) + abs(spec.depth - depth), default=None)
    return tuple(
        Measure(name=f"{name} of the rack", value=round(found, 3), expected=wanted, unit="m", setting="rack.specs")
        for name, found, wanted in (
            ("width", width, None if like is None else like.width),
            ("depth", depth, None if like is None else like.depth),
        )
    )


def _thing(role: Role, kind: ThingKind, place: Array) -> Thing:
    return Thing(role=role, kind=kind, x=round(float(place[0]), 3), y=round(float(place[1]), 3))
