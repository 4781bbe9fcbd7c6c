"""The pick station of the warehouse: what a rack presents at the rack point beside it is within the arm's reach."""

from __future__ import annotations

import math
from functools import cache

import mujoco
import numpy as np
import pytest

from rackhand.schemas import planar
from rackhand.services.controller import ik
from rackhand.services.sim.chassis.noise import NoiseSettings
from rackhand.services.sim.simulation import Simulation
from rackhand.worlds.arm_model import GRIPPER_LENGTH
from rackhand.worlds.world_model import World, load_world

POINT = (16.6, 12.2, math.pi / 2)
ABOVE = 0.03  # m above an item, where the cup is before and after the pick
CLEARANCE = 0.03  # m between the arm and a rack that is up to 3 cm and 1 degree off its point
HEADINGS = np.linspace(0.0, 2.0 * math.pi, 8, endpoint=False)  # of the cup about its own axis


@cache
def hall() -> World:
    """Without the chassis and the rack that is at p3 already."""
    world = load_world("warehouse")
    return world.model_copy(update={"robots": {}, "movers": {}})


def with_rack_at_p3(rack: str, off: tuple[float, float, float]) -> World:
    """That rack at p3 with what lies on it, ``off`` its point, and no other."""
    world = hall()
    at, pose = planar.compose(POINT, off), world.racks[rack].pose
    items = {
        name: item.model_copy(update={"pose": planar.compose(at, planar.between(pose, item.pose))})
        for name, item in world.items.items()
        if item.lies_on == rack
    }
    racks = {rack: world.racks[rack].model_copy(update={"pose": at})}
    return world.model_copy(update={"racks": racks, "items": items})


@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (0.03, 0.03, 0.0175), (-0.03, -0.03, -0.0175)])
@pytest.mark.parametrize(("rack", "items"), [("rack_s4", ("jar_1", "jar_2", "jar_3")), ("rack_p3", ("tin_1", "tin_2"))])
def test_the_arm_reaches_what_a_rack_presents_at_p3(
    rack: str, items: tuple[str, ...], off: tuple[float, float, float]
) -> None:
    simulation = Simulation(with_rack_at_p3(rack, off), {}, 0, NoiseSettings())
    for item in items:
        assert clearance_at(simulation, rack, item) >= CLEARANCE


def clearance_at(simulation: Simulation, rack: str, item: str) -> float:
    """Metres between the arm and the rack with the cup over the item, in the best of the postures tried; negative if
    there is none."""
    model, data, arm = simulation.model, simulation.data, ik.load_arm("ur5e")
    over = data.body(item).xpos.copy()
    over[2] += simulation.world.items[item].size[2] / 2 + ABOVE + GRIPPER_LENGTH
    base, turned = data.body("arm1/base").xpos.copy(), data.body("arm1/base").xmat.reshape(3, 3).copy()
    joints = [model.jnt_qposadr[j] for j in range(model.njnt) if model.joint(j).name.startswith("arm1/")]
    links = [g for g in range(model.ngeom) if model.geom(g).name.startswith("arm1/")]
    parts = [g for g in range(model.ngeom) if model.geom(g).name.startswith(f"{rack}/")]
    best = -1.0
    for heading in HEADINGS:
        c, s = math.cos(heading), math.sin(heading)
        down = np.array([[c, s, 0.0], [s, -c, 0.0], [0.0, 0.0, -1.0]])
        solution = ik.solve_pose(arm, turned.T @ np.column_stack([down, over - base]), arm.home, restarts=6)
        if not solution.reached:
            continue
        data.qpos[joints] = solution.q
        mujoco.mj_kinematics(model, data)
        gaps = (mujoco.mj_geomDistance(model, data, link, part, 0.2, None) for link in links for part in parts)
        best = max(best, min(gaps))
    return best
