"""Pose search: everything reachable is found; what is not is said to be not; the same seed gives the same answer."""

import numpy as np
import pytest

from rackhand.services.controller.ik import Arm, forward, solve_pose


def test_random_pairs_are_all_solved(arm: Arm) -> None:
    """1 000 random starts and goals within 20 restarts, to 1 mm and 0.5°."""
    random = np.random.default_rng(7)
    for i in range(1000):
        goal, start = random.uniform(arm.limits.lower, arm.limits.upper, (2, arm.n))
        target = forward(arm, goal)
        found = solve_pose(arm, target, start, linear_tolerance=1e-3, angular_tolerance=np.deg2rad(0.5), seed=i)
        assert found.reached
        assert np.linalg.norm(forward(arm, found.q)[:, 3] - target[:, 3]) <= 1e-3
        assert np.all((found.q >= arm.limits.lower) & (found.q <= arm.limits.upper))


def test_solve_rate_of_the_published_task(arm: Arm) -> None:
    """The task of TRAC-IK (Beeson & Ames 2015), a tenth of it: random reachable poses from one start, to 1e-5."""
    random = np.random.default_rng(8)
    goals = random.uniform(arm.limits.lower, arm.limits.upper, (1000, arm.n))
    solved = [solve_pose(arm, forward(arm, goal), arm.home, seed=i).reached for i, goal in enumerate(goals)]
    assert np.mean(solved) >= 0.995


def test_out_of_reach_is_said_and_the_nearest_given(arm: Arm) -> None:
    target = forward(arm, arm.home)
    target[:, 3] = [3.0, 0.0, 0.3]
    found = solve_pose(arm, target, arm.home, restarts=3)
    assert not found.reached
    assert 1.5 < found.linear_error < 2.5
    assert found.restarts == 3
    assert np.all((found.q >= arm.limits.lower) & (found.q <= arm.limits.upper))


def test_same_seed_same_answer_and_inputs_untouched(arm: Arm) -> None:
    random = np.random.default_rng(9)
    goal, start = random.uniform(arm.limits.lower, arm.limits.upper, (2, arm.n))
    before, target = start.copy(), forward(arm, goal)
    first, second = solve_pose(arm, target, start, seed=4), solve_pose(arm, target, start, seed=4)
    np.testing.assert_array_equal(first.q, second.q)
    np.testing.assert_array_equal(start, before)


def test_continues_from_where_it_is(arm: Arm) -> None:
    """Without restarts the answer is the near one, as following a path needs it."""
    q = arm.home + 0.02
    found = solve_pose(arm, forward(arm, q), arm.home, restarts=0)
    assert found.reached
    assert np.max(np.abs(found.q - arm.home)) < 0.1


@pytest.mark.parametrize("shape", [(4, 4), (3, 3)])
def test_bad_target_is_refused(ur5e: Arm, shape: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match=r"\(3, 4\) target"):
        solve_pose(ur5e, np.eye(*shape), ur5e.home)
    with pytest.raises(ValueError, match="finite"):
        solve_pose(ur5e, np.full((3, 4), np.nan), ur5e.home)
