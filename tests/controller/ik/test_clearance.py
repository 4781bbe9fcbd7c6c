"""Distances of the arm's solids, against MuJoCo's own for the same scene."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from rackhand.schemas.arrays import Array
from rackhand.services.controller import ik
from rackhand.services.controller.ik.clearance import MARGIN
from rackhand.services.controller.ik.solids import levers
from tests.controller.station import CELLS, scene

BOTH = pytest.mark.parametrize("kind", ["ur5e", "fr3"])


def postures(arm: ik.Arm, count: int, seed: int = 1) -> Array:
    rng = np.random.default_rng(seed)
    return rng.uniform(np.maximum(arm.limits.lower, -3.2), np.minimum(arm.limits.upper, 3.2), (count, arm.n))


@BOTH
def test_distances_are_those_of_the_physics(kind: str) -> None:
    arm, (model, data, joints) = CELLS[kind], scene(kind)
    clearance = ik.Clearance(arm)
    geoms = {model.geom(i).name.removeprefix("arm1/").removesuffix("#0"): i for i in range(model.ngeom)}
    assert ("wrist_2" if kind == "ur5e" else "link6", "tote_table") in clearance.pairs
    for q in postures(arm, 15):
        data.qpos[joints] = q
        mujoco.mj_kinematics(model, data)
        for (a, b), distance in zip(clearance.pairs, clearance.distances(q), strict=True):
            if b == "floor" or distance < 0.0:
                continue  # how deep solids overlap is a matter of definition
            expected = mujoco.mj_geomDistance(model, data, geoms[a], geoms[b], 5.0, None)
            assert abs(distance - expected) < 1e-4, (a, b, distance, expected)


@BOTH
def test_no_point_moves_farther_than_the_levers_say(kind: str) -> None:
    arm, (model, data, joints) = CELLS[kind], scene(kind)
    rng = np.random.default_rng(2)
    travel = ik.Clearance(arm).travel
    moving = [i for i in range(model.ngeom) if model.geom(i).name.startswith("arm1/")]
    for q in postures(arm, 15):
        places = []
        step = rng.normal(scale=0.05, size=arm.n)
        for at in (q, q + step):
            data.qpos[joints] = at
            mujoco.mj_kinematics(model, data)
            places.append(data.geom_xpos[moving].copy())
        assert np.linalg.norm(places[1] - places[0], axis=1).max() <= travel(np.array([q, q + step]))[-1]
    assert (np.diff(levers(arm, arm.solids)) <= 0).all()


def test_the_first_conflict_of_a_row_of_postures_is_found_and_named() -> None:
    arm = CELLS["ur5e"]
    clearance = ik.Clearance(arm)
    down = arm.home + np.pi * np.eye(6)[0] + np.outer(np.linspace(0, 1.2, 400), np.eye(6)[1])
    found = clearance.first_conflict(down)
    every = np.array([clearance.distances(q).min() for q in down])
    assert found is not None and found.number == int(np.argmax(every < MARGIN))
    assert "tote_table" in found.pair and "come within" in str(found)
    assert clearance.first_conflict(down[: found.number]) is None
    assert clearance.first_conflict(down[found.number + 5 :: -1]) is None, "it may recede from what it is near to"
    deeper = clearance.first_conflict(down[found.number + 5 :])
    assert deeper is not None and deeper.number < 5


@BOTH
@pytest.mark.parametrize("seed", [0, 1, 4])
def test_the_arm_brakes_within_its_limits_before_it_touches(kind: str, seed: int) -> None:
    arm, dt = CELLS[kind], 0.004
    clearance, rng = ik.Clearance(arm), np.random.default_rng(seed)
    q, v, slowed = arm.home.copy(), np.zeros(arm.n), False
    direction = rng.normal(size=arm.n)
    wanted = direction / np.abs(direction / arm.limits.velocity).max()
    gained = arm.limits.acceleration * dt
    for _ in range(1500):
        faster = v + np.clip(wanted - v, -0.3 * gained, 0.3 * gained)
        share = clearance.speed_share(q, faster, dt)
        slowed = slowed or share < 1.0
        v = np.clip(share * faster, v - gained, v + gained)
        q = q + v * dt
        if np.abs(q).max() > 8.0 or (slowed and np.abs(v).max() < 1e-4):
            break
    assert slowed, "this motion meets nothing"
    assert clearance.distances(q).min() > MARGIN - 5e-4
    assert clearance.speed_share(q, -wanted * 0.01, dt) == 1.0, "the way back is free"
