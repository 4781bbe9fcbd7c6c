"""Arms in the pick station: as the controller has them, and as the physics has them."""

from __future__ import annotations

from typing import Any

import mujoco

from rackhand.services.controller import ik
from rackhand.services.sim.mjcf.scene import build_model
from rackhand.worlds.arm_model import load_arm_descriptions, with_arm_kind
from rackhand.worlds.world_model import load_world

WORLD = load_world("pick_station")
CELLS = {kind: ik.in_station(ik.load_arm(kind), with_arm_kind(WORLD, kind), "arm1") for kind in ("ur5e", "fr3")}


def scene(kind: str) -> tuple[Any, Any, slice]:
    """MuJoCo's model and data of the station, and where the arm's joint positions are."""
    world = with_arm_kind(WORLD, kind)
    model = build_model(world, {}, load_arm_descriptions(world))
    data = mujoco.MjData(model)
    first = min(int(model.jnt_qposadr[i]) for i in range(model.njnt) if model.joint(i).name.startswith("arm1/"))
    return model, data, slice(first, first + CELLS[kind].n)
