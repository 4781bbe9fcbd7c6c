from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rackhand.services.planner.geometry.footprint import RIM, Footprint, distance_to_body, edge_distance, expanded
from rackhand.services.planner.geometry.se2 import compose
from tests.planner.plant import BODY

FOOTPRINT = Footprint.of(BODY)
HALF_LENGTH, HALF_WIDTH = 0.375, 0.23


@st.composite
def convex(draw: st.DrawFn) -> np.ndarray:
    """A polygon on an ellipse around the origin: convex, whatever its angles."""
    n = draw(st.integers(4, 9))
    shifts = draw(st.lists(st.floats(-0.3, 0.3), min_size=n, max_size=n))
    angles = (np.arange(n) + shifts) * 2 * math.pi / n
    return np.column_stack([draw(st.floats(0.2, 1.0)) * np.cos(angles), draw(st.floats(0.2, 1.0)) * np.sin(angles)])


@given(convex())
def test_large_discs_are_inside_and_the_corners_among_the_small(polygon: np.ndarray) -> None:
    body = Footprint.of(polygon)
    for x, y, radius in body.samples[body.samples[:, 2] > RIM]:
        assert edge_distance(body.edges, x, y) <= 1e-9 - radius
    for corner in polygon:
        assert np.hypot(*(body.samples[:, :2] - corner).T).min() < 1e-9


@given(convex(), st.floats(-2, 2), st.floats(-2, 2))
def test_signed_distance_is_negative_inside_and_a_lower_bound(polygon: np.ndarray, x: float, y: float) -> None:
    body = Footprint.of(polygon)
    sides = np.roll(body.polygon, -1, axis=0) - body.polygon
    rel = np.array([x, y]) - body.polygon
    t = np.clip(np.sum(rel * sides, axis=1) / np.sum(sides**2, axis=1), 0, 1)
    exact = float(np.hypot(*(rel - t[:, None] * sides).T).min())
    inside = bool((sides[:, 0] * rel[:, 1] - sides[:, 1] * rel[:, 0] > 0).all())
    found = edge_distance(body.edges, x, y)
    if exact > 1e-9:
        assert (found < 0.0) == inside
    assert found == pytest.approx(-exact, abs=1e-9) if inside else found <= exact + 1e-9


def test_signed_distance_beside_a_side_and_beyond_a_corner() -> None:
    assert edge_distance(FOOTPRINT.edges, 0.0, 0.0) == pytest.approx(-HALF_WIDTH)
    assert edge_distance(FOOTPRINT.edges, 1.0, 0.1) == pytest.approx(1.0 - HALF_LENGTH)
    assert edge_distance(FOOTPRINT.edges, HALF_LENGTH + 0.3, HALF_WIDTH + 0.4) == pytest.approx(0.4)


@given(convex(), st.floats(0.0, 0.3))
def test_an_expanded_polygon_has_its_sides_so_much_further_out(polygon: np.ndarray, distance: float) -> None:
    body = Footprint.of(polygon)
    larger = Footprint.of(expanded(body.polygon, distance))
    assert larger.edges[:, :2] == pytest.approx(body.edges[:, :2], abs=1e-6)
    assert larger.edges[:, 2] == pytest.approx(body.edges[:, 2] + distance)


@given(st.floats(-5, 5), st.floats(-5, 5), st.floats(-4, 4))
def test_distance_to_the_body_moves_with_it(x: float, y: float, yaw: float) -> None:
    pose = np.array([x, y, yaw])
    point = compose(pose, np.array([0.9, -0.1, 0.0]))
    assert distance_to_body(FOOTPRINT.edges, pose, point[0], point[1]) == pytest.approx(0.9 - HALF_LENGTH)


@pytest.mark.parametrize(
    "polygon",
    [
        [(0, 0), (1, 0)],
        [(1, 1), (2, 1), (2, 2)],
        [(1, 0), (0.1, 0.1), (0, 1), (-1, -1)],
        [(1, 0), (0, 1), (float("nan"), 0)],
    ],
)
def test_footprint_must_be_convex_around_the_origin(polygon: list) -> None:
    with pytest.raises(ValueError, match="footprint"):
        Footprint.of(np.array(polygon, dtype=float))


def test_footprint_either_way_round() -> None:
    one, other = Footprint.of(BODY), Footprint.of(BODY[::-1])
    assert one.inscribed == other.inscribed == pytest.approx(HALF_WIDTH)
    assert one.circumscribed == other.circumscribed == pytest.approx(math.hypot(HALF_LENGTH, HALF_WIDTH))


def test_arrays_are_of_the_one_kind_that_code_is_compiled_for() -> None:
    given = np.asfortranarray(BODY.astype(np.float32))
    given.flags.writeable = False
    body = Footprint.of(given)
    for array in (body.polygon, body.samples, body.edges):
        assert array.flags.c_contiguous and array.flags.writeable and array.dtype == np.float64
