"""Geometry as data: what the simulator's primitives become."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rackhand.schemas.world import Scene, SceneGeom
from rackhand.services.viewer.geometry import draw, grouped, halls, quaternions_xyzw, rotation_matrices

IDENTITY = (1.0, 0.0, 0.0, 0.0)
WHITE = np.ones(4, dtype=np.float32)


def geom(shape: str, size: tuple[float, float, float], position=(0.0, 0.0, 0.0), orientation=IDENTITY, body="world"):
    return SceneGeom.model_validate(
        {"body": body, "shape": shape, "size": size, "position": position, "orientation": orientation, "rgba": WHITE}
    )


def about(axis: int, angle: float) -> tuple[float, float, float, float]:
    vector = [0.0, 0.0, 0.0]
    vector[axis] = math.sin(angle / 2)
    return (math.cos(angle / 2), *vector)  # type: ignore[return-value]


def test_a_quaternion_turns_as_its_matrix() -> None:
    turned = rotation_matrices(np.array([about(2, math.pi / 2), about(0, math.pi / 2)])) @ np.array([0.0, 1.0, 0.0])
    assert turned == pytest.approx(np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), abs=1e-12)


def test_rerun_gets_the_real_part_last() -> None:
    assert quaternions_xyzw([(1.0, 2.0, 3.0, 4.0)]).tolist() == [[2.0, 3.0, 4.0, 1.0]]


def test_an_endless_floor_is_a_slab_under_everything_with_its_top_at_zero() -> None:
    scene = Scene(stamp=0, geoms=(geom("plane", (0, 0, 1)), geom("box", (1, 2, 0.5), (3, 0, 0.5))))
    floor, _ = grouped(scene)["world", "box"]
    top = floor.position[2] + floor.size[2]
    assert top == pytest.approx(0.0)
    assert floor.position[0] - floor.size[0] < 2.0 and floor.position[0] + floor.size[0] > 4.0


def test_bounds_know_how_shapes_lie() -> None:
    lying = geom("cylinder", (0.1, 2.0, 0.0), (1.0, 0.0, 0.1), about(0, math.pi / 2))
    (found,) = halls(Scene(stamp=0, geoms=(lying, geom("box", (9, 9, 9), body="amr1"))))
    assert found == pytest.approx(np.array([[0.9, -2.0, 0.0], [1.1, 2.0, 0.2]]))


def test_each_hall_has_its_bounds_and_its_floor_and_the_fullest_is_first() -> None:
    far = geom("box", (1, 1, 0.5), (45, 0, 0.5))
    near = [geom("box", (1, 1, 0.5), (x, y, 0.5)) for x, y in ((0, 0), (8, 0), (8, 9))]
    scene = Scene(stamp=0, geoms=(far, *near, geom("plane", (0, 0, 1))))
    assert np.array(halls(scene))[:, :, :2].tolist() == [[[-1, -1], [9, 10]], [[44, -1], [46, 1]]]
    slabs = [shape for shape in grouped(scene)["world", "box"] if shape.position[2] < 0]
    assert [slab.position[0] for slab in slabs] == [4.0, 45.0]


def test_no_hall_has_no_bounds_and_a_floor() -> None:
    scene = Scene(stamp=0, geoms=(geom("plane", (0, 0, 1)),))
    assert halls(scene) == []
    assert len(grouped(scene)["world", "box"]) == 1


def test_a_capsule_begins_where_its_lower_half_does() -> None:
    """Rerun's capsules start at their origin, MuJoCo's have it in their middle."""
    lying = geom("capsule", (0.1, 0.5, 0.0), (1.0, 2.0, 3.0), about(1, math.pi / 2))  # its axis is now +x
    capsule = draw(("world", "capsule"), (lying,)).parts[0]
    assert capsule.translations.as_arrow_array().to_pylist()[0] == pytest.approx([0.5, 2.0, 3.0])
    assert capsule.lengths.as_arrow_array().to_pylist() == [1.0]


def test_bodies_are_drawn_in_their_own_frame() -> None:
    assert draw(("amr1/jack", "box"), (geom("box", (1, 1, 1), body="amr1/jack"),)).frame == "amr1/jack"
    assert draw(("world", "box"), (geom("box", (1, 1, 1)),)).frame == "map"
