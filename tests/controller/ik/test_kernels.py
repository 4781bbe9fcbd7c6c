"""The arithmetic: Jacobians by finite differences, log6 against pinocchio, the box QP against OSQP."""

import numpy as np
import osqp
import pinocchio as pin
import pytest
import scipy.sparse as sparse
from hypothesis import example, given, settings
from hypothesis import strategies as st

from rackhand.services.controller.ik import Arm, SolverSettings, load_arm, velocity_box
from rackhand.services.controller.ik import kernels as k
from rackhand.services.controller.ik.collision import RESERVE, Zone, build_table, collision_rows, gap
from rackhand.services.controller.ik.objectives import KINDS, CollisionAvoidanceSphere, DesiredJointPositions
from rackhand.services.controller.ik.servo import arm_tables

_UR5E = load_arm("ur5e")


def frames_at(arm: Arm, q: np.ndarray) -> np.ndarray:
    frames = np.empty((arm.n + 1, 3, 4))
    k.forward(arm.placements, q, frames)
    return frames


def error_between(pose: np.ndarray, target: np.ndarray) -> np.ndarray:
    error = np.empty(6)
    k.pose_error(np.ascontiguousarray(pose), np.ascontiguousarray(target), np.ones(6), error)
    return error


def test_frame_task_jacobian_by_finite_differences(arm: Arm) -> None:
    random, jac = np.random.default_rng(0), np.empty((6, arm.n))
    for _ in range(20):
        q, dq = random.uniform(arm.limits.lower, arm.limits.upper), random.normal(size=arm.n)
        frames = frames_at(arm, q)
        k.jacobian(frames, jac)
        ahead, behind = frames_at(arm, q + 1e-6 * dq)[-1], frames_at(arm, q - 1e-6 * dq)[-1]
        np.testing.assert_allclose(error_between(behind, ahead) / 2e-6, jac @ dq, atol=1e-7)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.0, 1e-9, 1e-5, 0.3, 1.0, 3.0, np.pi - 1e-6, np.pi]))
def test_pose_error_is_log6(seed: int, angle: float) -> None:
    random = np.random.default_rng(seed)
    axis = random.normal(size=3)
    turn = pin.exp3(angle * axis / np.linalg.norm(axis))
    a = pin.SE3(pin.exp3(random.normal(size=3)), random.normal(size=3))
    b = a * pin.SE3(turn, random.normal(size=3))
    error = error_between(a.homogeneous[:3], b.homogeneous[:3])
    assert np.linalg.norm(error[3:]) <= np.pi + 1e-9
    np.testing.assert_allclose((a * pin.exp6(error)).homogeneous, b.homogeneous, atol=2e-7)
    if angle < 3.1:
        np.testing.assert_allclose(error, pin.log6(a.actInv(b)).vector, atol=1e-7)


def slope(arm: Arm, q: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Of half the squared distance to the target's origin."""
    frames, jac = frames_at(arm, q), np.empty((6, arm.n))
    k.jacobian(frames, jac)
    return -jac[:3].T @ frames[-1, :, :3].T @ (target - frames[-1, :, 3])


def test_curved_normal_matrix_is_the_second_derivative_of_the_distance(arm: Arm) -> None:
    random, jac, h = np.random.default_rng(4), np.empty((6, arm.n)), np.empty((arm.n, arm.n))
    for _ in range(10):
        q, target = random.uniform(arm.limits.lower, arm.limits.upper), random.normal(size=3)
        frames = frames_at(arm, q)
        k.jacobian(frames, jac)
        k.normal_matrix(jac, np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]), 0.0, h)
        k.subtract_curvature(jac, frames[-1, :, :3].T @ (target - frames[-1, :, 3]), h)
        for i, unit in enumerate(1e-6 * np.eye(arm.n)):
            column = (slope(arm, q + unit, target) - slope(arm, q - unit, target)) / 2e-6
            np.testing.assert_allclose(h[i], column, atol=1e-7)


def test_the_goal_of_a_target_out_of_reach_moves_along_with_it(arm: Arm) -> None:
    """Once found, a few steps a tick keep it, however slowly first derivatives alone would lead there."""
    tables = arm_tables(arm, 0.004, SolverSettings())
    far, q = frames_at(arm, arm.home)[-1], arm.home.copy()
    out = far[:, 3] / np.linalg.norm(far[:, 3])
    frames = np.empty((arm.n + 1, 3, 4))
    for _ in range(20):
        far[:, 3] += 0.05 * out
        k.forward(arm.placements, q, frames)
        k.newton_solve(tables, far, q, frames, 100)
    for _ in range(10):
        far[:, 3] += 0.002 * out
        k.forward(arm.placements, q, frames)
        left, ended = k.newton_solve(tables, far, q, frames, 4)
        assert ended
    assert left > 0.3


def test_manipulability(arm: Arm) -> None:
    jac = np.empty((6, arm.n))
    k.jacobian(frames_at(arm, arm.home), jac)
    assert k.manipulability(jac) == pytest.approx(np.sqrt(np.linalg.det(jac @ jac.T)), rel=1e-9)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_objective_is_the_slope_of_its_cost(arm: Arm, kind: type) -> None:
    random = np.random.default_rng(1)
    objective = kind(arm)
    if isinstance(objective, DesiredJointPositions):
        objective.attraction = arm.home.copy()
        objective.attraction[2] = np.nan
    if isinstance(objective, CollisionAvoidanceSphere):
        objective.center, objective.radius, objective.range = np.array([-0.3, 0.1, 0.4]), 0.1, 0.5
    felt = 0.0
    for _ in range(10):
        q, dq = random.uniform(arm.limits.lower, arm.limits.upper), random.normal(size=arm.n)
        slope = (objective.cost(q + 1e-6 * dq) - objective.cost(q - 1e-6 * dq)) / 2e-6
        assert -objective.velocity(q) @ dq == pytest.approx(slope, abs=1e-5, rel=1e-5)
        felt = max(felt, abs(slope))
    assert felt > 1e-3


def test_collision_rows_by_finite_differences(arm: Arm) -> None:
    zones = [Zone((0.4, 0.2, 0.3), 0.2), Zone((0, 0, 0.4), 1.0, keep_in=True)]
    table = build_table(arm, zones, True, 0.01)
    random, row, other = np.random.default_rng(2), np.empty(arm.n), np.empty(arm.n)
    for _ in range(5):
        q, dq = random.uniform(arm.limits.lower, arm.limits.upper), random.normal(size=arm.n)
        frames, ahead, behind = frames_at(arm, q), frames_at(arm, q + 1e-6 * dq), frames_at(arm, q - 1e-6 * dq)
        rows, bounds, gaps = np.empty((len(table), arm.n)), np.empty(len(table)), np.empty(len(table))
        collision_rows(table, arm.limits.acceleration, 0.004, frames, rows, bounds, gaps)
        for i, pair in enumerate(table):
            assert gap(pair, frames, row) == gaps[i]
            slope = (gap(pair, ahead, other) - gap(pair, behind, other)) / 2e-6
            assert row @ dq == pytest.approx(slope, abs=1e-6)
            np.testing.assert_array_equal(rows[i], -row)
        assert np.all(bounds[gaps > RESERVE] >= 0)
        assert np.all(bounds[gaps < RESERVE] <= 0)


def random_qp(seed: int, n: int) -> tuple[np.ndarray, ...]:
    """A QP as a tick has it, from well to badly conditioned."""
    random = np.random.default_rng(seed)
    jac = random.normal(size=(6, n)) * 10.0 ** random.uniform(-3, 0, size=(6, 1))
    h = jac.T @ jac + 10.0 ** random.uniform(-6, -1) * np.eye(n)
    width = 10.0 ** random.uniform(-3, 0, n)
    center = random.normal(size=n) * 0.3
    return h, h @ (center + random.normal(size=n) * 2 * width), center - width, center + width


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7))
@example(4151757037, 7)  # projected Newton alone zigzags for ever
def test_box_solution_meets_its_conditions(seed: int, n: int) -> None:
    h, c, lower, upper = random_qp(seed, n)
    x = np.zeros(n)
    assert k.solve_box(h, c, lower, upper, x) > 0
    assert np.all(x >= lower)
    assert np.all(x <= upper)
    # Where a coordinate is free, Newton's step on the free ones is none; where it is not, the slope pushes outwards.
    slope = h @ x - c
    free = (x > lower) & (x < upper)
    if free.any():
        assert np.max(np.abs(np.linalg.solve(h[np.ix_(free, free)], slope[free]))) < 1e-8
    assert np.all(slope[x == lower] >= -1e-9)
    assert np.all(slope[x == upper] <= 1e-9)


@settings(max_examples=200, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(2, 7))
def test_both_ways_to_the_box_solution_meet(seed: int, n: int) -> None:
    h, c, lower, upper = random_qp(seed, n)
    x, y = np.zeros(n), np.clip(np.zeros(n), lower, upper)
    k.solve_box(h, c, lower, upper, x)
    assert k.walk_faces(h, c, lower, upper, y) > 0
    np.testing.assert_allclose(x, y, atol=1e-8)


@pytest.mark.parametrize("seed", range(20))
def test_fast_paths_equal_osqp(seed: int) -> None:
    h, c, lower, upper = random_qp(seed, 6)
    x = np.zeros(6)
    k.solve_box(h, c, lower, upper, x)
    solver = osqp.OSQP()
    tight = {"eps_abs": 1e-10, "eps_rel": 1e-10, "max_iter": 200000, "verbose": False, "check_dualgap": False}
    solver.setup(sparse.csc_matrix(np.triu(h)), -c, sparse.eye(6, format="csc"), lower, upper, **tight)
    theirs = solver.solve(raise_error=False).x
    np.testing.assert_allclose(x, theirs, atol=2e-5)
    assert 0.5 * x @ h @ x - c @ x <= 0.5 * theirs @ h @ theirs - c @ theirs + 1e-9


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_box_is_never_empty_and_never_left(data: st.DataObject) -> None:
    """Whatever velocities are picked from the box: every limit holds, and every next box has something in it."""
    arm = _UR5E
    dt = data.draw(st.sampled_from([0.001, 0.002, 0.004, 0.02]))
    random = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    q, v = random.uniform(arm.limits.lower, arm.limits.upper), np.zeros(6)
    pick = np.where(random.random(6) < 0.5, 1.0, 0.0)
    for _ in range(200):
        lower, upper = velocity_box(arm, q, v, dt)
        assert np.all(lower <= upper)
        pick = np.where(random.random(6) < 0.02, random.random(6).round(), pick)
        new = lower + pick * (upper - lower)
        assert np.all(np.abs(new - v) <= arm.limits.acceleration * dt * (1 + 1e-9))
        assert np.all(np.abs(new) <= arm.limits.velocity * (1 + 1e-12))
        v = new
        q = q + v * dt
        assert np.all(q >= arm.limits.lower - 1e-9)
        assert np.all(q <= arm.limits.upper + 1e-9)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(-20, 20), min_size=12, max_size=12))
def test_box_is_never_empty_from_a_broken_start(state: list[float]) -> None:
    q, v = np.array(state[:6]), np.array(state[6:])
    lower, upper = velocity_box(_UR5E, q, v, 0.004)
    assert np.all(lower <= upper)
    assert np.all(np.abs(np.array([lower, upper]) - v) <= _UR5E.limits.acceleration * 0.004 * (1 + 1e-9))
