"""A sealed cup: no creep within what the suction holds, and off beyond it."""

from __future__ import annotations

from functools import cache

import mujoco
import numpy as np
import pytest

from rackhand.services.sim.mjcf.arm_model import SHEAR_SHARE, SUCTION_FORCE
from rackhand.services.sim.simulation import Simulation
from rackhand.worlds.arm_model import GRIPPER_LENGTH, GRIPPER_RADIUS
from tests.sim.arm.test_arm import EXACT, control, crate_world, lift_the_crate, state_of

WEIGHT = 2.0 * 9.81


@cache
def lifted() -> Simulation:
    simulation = Simulation(crate_world(), {}, 0, EXACT)
    lift_the_crate(simulation)
    return simulation


@pytest.fixture
def holding() -> Simulation:
    """With the crate at its cup: one for all tests, as long as none drops it."""
    simulation = lifted()
    hold(simulation, 0.1)
    if not held(simulation):
        lifted.cache_clear()
        simulation = lifted()
    return simulation


def hold(
    simulation: Simulation, seconds: float, force: tuple[float, float, float] = (0.0, 0.0, 0.0), moment: float = 0.0
) -> None:
    """Stands still while ``force`` [N], which grows in the first 0.1 s, acts on the crate at the middle of the cup's
    rim, and ``moment`` [N·m] about y likewise."""
    body, data = simulation.model.body("crate").id, simulation.data
    tool = data.site("arm1/tool")
    rim = tool.xpos + GRIPPER_LENGTH * tool.xmat.reshape(3, 3)[:, 2]
    whole = np.append(force, np.cross(rim - data.body("crate").xipos, force))
    whole[4] += moment

    def still(time: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        data.xfrc_applied[body] = whole * min(time / 0.1, 1.0)
        return np.zeros(6)

    control(simulation, seconds, "velocity", still, suction=True)
    data.xfrc_applied[body] = 0.0


def held(simulation: Simulation) -> bool:
    gripper = state_of(simulation).gripper
    assert gripper is not None
    return gripper.holding


def offset(simulation: Simulation) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """The crate in the frame of the tool [m]."""
    data = simulation.data
    tool = data.site("arm1/tool")
    return np.asarray(tool.xmat.reshape(3, 3).T @ (data.body("crate").xpos - tool.xpos))


def test_a_held_load_does_not_creep_under_a_shear_that_alternates(holding: Simulation) -> None:
    places = []
    for _ in range(3):
        for side in (1, -1, 0):
            hold(holding, 0.15, (0.5 * SHEAR_SHARE * SUCTION_FORCE * side, 0.0, 0.0))
        places.append(offset(holding))
    assert held(holding) and np.ptp(places[1:], axis=0).max() < 1e-5


@pytest.mark.parametrize(
    ("force", "moment", "holds"),
    [
        ((0.0, 0.0, -10.0), 0.0, True),  # the crate is aslant: its weight is a moment at the rim, too
        ((0.0, 0.0, 1.2 * (WEIGHT - SUCTION_FORCE)), 0.0, False),
        ((0.0, 0.0, 60.0), 0.0, True),
        ((2.0 * SHEAR_SHARE * SUCTION_FORCE, 0.0, 20.0), 0.0, False),
        ((0.0, 0.0, 0.0), 1.5 * GRIPPER_RADIUS * SUCTION_FORCE, False),
        ((0.0, 0.0, 0.0), -1.5 * GRIPPER_RADIUS * SUCTION_FORCE, False),
    ],
    ids=["pull", "too great a pull", "pressed", "too great a shear", "peeled off", "peeled off on the other side"],
)
def test_a_load_is_held_up_to_the_rated_forces(
    holding: Simulation, force: tuple[float, float, float], moment: float, holds: bool
) -> None:
    hold(holding, 0.2, force, moment)
    assert held(holding) == holds


def test_what_is_taken_away_is_let_go_without_a_jerk(holding: Simulation) -> None:
    address = holding.model.joint(holding.model.body("crate").jntadr[0]).qposadr[0]
    before = np.array(state_of(holding).q)
    holding.data.qpos[address : address + 3] += (0.0, 0.5, 0.0)
    mujoco.mj_kinematics(holding.model, holding.data)
    hold(holding, 0.05)
    assert not held(holding)
    assert np.abs(np.array(state_of(holding).q) - before).max() < 2e-3
