"""The compiled model as data for viewers: names, poses of what moves, and all shapes."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import mujoco
import numpy as np

from rackhand.schemas.world import Scene, SceneGeom
from rackhand.services.sim.actors.obstacles import Obstacles
from rackhand.services.sim.mjcf.layers import PARKED_GROUP

_SHAPES = {
    int(mujoco.mjtGeom.mjGEOM_PLANE): "plane",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
}
WORLD_BODY = "world"


def owners(model: Any, compounds: Collection[str]) -> list[str]:
    """For each geom the name of the thing it belongs to: a robot, rack, static, one of the ``compounds`` (arms and
    lifts, which are several bodies); slots by their own names."""
    names = []
    for geom in range(model.ngeom):
        root = int(model.body_rootid[model.geom_bodyid[geom]])
        name = model.geom(geom).name.split("#")[0] if root == 0 else model.body(root).name
        names.append(whole if (whole := name.split("/")[0]) in compounds else name)
    return names


def parts(model: Any, compounds: Collection[str], robots: Collection[str]) -> list[str]:
    """For each geom the name of the part of the world it belongs to, as ``Touch`` has it."""
    labels = owners(model, compounds)
    for geom, owner in enumerate(labels):
        if owner in robots:
            part = model.geom(geom).name.removeprefix(f"{owner}/")
            labels[geom] = f"{owner}/{part if part in ('hull', 'jack') else 'wheels'}"
    return labels


def moving_bodies(model: Any) -> dict[str, int]:
    """Name → body of all that moves by itself: robots, arms and their parts, racks."""
    return {model.body(body).name: body for body in range(1, model.nbody) if model.body_mocapid[body] < 0}


def scene(model: Any, stamp: int, obstacles: Obstacles) -> Scene:
    """Every visible primitive in its body's frame; parked slots and what is drawn transparent are left out."""
    names = {body: name for name, body in moving_bodies(model).items()}
    names |= {obstacles.body_of(placed): name for name, placed in obstacles.placed.items()}
    geoms = []
    for geom in range(model.ngeom):
        if model.geom_group[geom] == PARKED_GROUP or model.geom_rgba[geom][3] == 0:
            continue
        geoms.append(
            SceneGeom.model_validate(
                {
                    "body": names.get(int(model.geom_bodyid[geom]), WORLD_BODY),
                    "shape": _SHAPES[int(model.geom_type[geom])],
                    "size": tuple(model.geom_size[geom].tolist()),
                    "position": tuple(model.geom_pos[geom].tolist()),
                    "orientation": tuple(model.geom_quat[geom].tolist()),
                    "rgba": model.geom_rgba[geom].astype(np.float32),
                }
            )
        )
    return Scene(stamp=stamp, geoms=tuple(geoms))
