"""Geoms that were moved within their body: where they are in the map, and the boxes by which collisions and rays are
culled."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def geoms_moved(model: Any, data: Any, body: int) -> None:
    """The geoms of a body have other places in it. The frames of what sleeps or never moves are not computed at each
    step, so that this is done here."""
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        frame = data.xmat[body].reshape(3, 3)
        data.geom_xpos[geom] = data.xpos[body] + frame @ model.geom_pos[geom]
        data.geom_xmat[geom] = (frame @ _matrix(model.geom_quat[geom])).ravel()
    _refit_bounds(model, body)


def _refit_bounds(model: Any, body: int) -> None:
    """Fit the body's tree of boxes to where its geoms are now. Boxes are in the body's inertia frame: middle, half
    size."""
    first, count = int(model.body_bvhadr[body]), int(model.body_bvhnum[body])
    inertia = _matrix(model.body_iquat[body])
    for node in range(first + count - 1, first - 1, -1):  # children come after their parent
        geom = int(model.bvh_nodeid[node])
        if geom >= 0:
            model.bvh_aabb[node] = _box_of(model, geom, model.body_ipos[body], inertia)
            continue
        boxes = np.array([model.bvh_aabb[first + child] for child in model.bvh_child[node] if child >= 0])
        low, high = (boxes[:, :3] - boxes[:, 3:]).min(axis=0), (boxes[:, :3] + boxes[:, 3:]).max(axis=0)
        model.bvh_aabb[node] = [*(low + high) / 2, *(high - low) / 2]


def _box_of(model: Any, geom: int, origin: Array, inertia: Array) -> list[float]:
    rotation = _matrix(model.geom_quat[geom])
    middle, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
    turned = inertia.T @ rotation
    placed = inertia.T @ (model.geom_pos[geom] + rotation @ middle - origin)
    return [*placed, *(np.abs(turned) @ half)]


def _matrix(quaternion: Array) -> Array:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)
