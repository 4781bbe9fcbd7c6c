from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rackhand.services.controller.trajectory.geometry import rotation_exp
from rackhand.services.controller.trajectory.model import TcpPose
from rackhand.services.controller.trajectory.simplify import Resolution, kept, kept_joints, kept_poses

RESOLUTION = Resolution()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.01, 3.0))
def test_every_waypoint_is_near_the_leg_that_passes_it(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(scale=size, size=(60, 3)), axis=0)
    needed = kept(points)
    assert (needed[0], needed[-1]) == (0, 59) and needed == sorted(set(needed))
    for a, b in pairwise(needed):
        for k in range(a + 1, b):
            leg = points[b] - points[a]
            along = np.clip((points[k] - points[a]) @ leg / max(leg @ leg, 1e-300), 0, 1)
            assert np.linalg.norm(points[k] - points[a] - along * leg) <= 1.0


def test_a_turn_back_and_a_closed_path_keep_their_far_points() -> None:
    assert kept(np.array([[0.0], [10.0], [20.0], [3.0]])) == [0, 2, 3]
    assert kept(np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 0.0]])) == [0, 1, 2, 3]
    assert kept(np.array([[0.0], [0.5], [0.0]])) == [0, 2]


@pytest.mark.parametrize("angle", [0.01, 0.5, 3.0])
def test_points_of_one_turn_about_a_fixed_axis_are_few_and_others_are_kept(angle: float) -> None:
    here, axis = np.zeros(3), np.array([0.0, 0.6, 0.8])
    turn = [TcpPose(here, rotation_exp(a * axis)) for a in np.linspace(0, angle, 50)]
    assert len(kept_poses(turn, RESOLUTION)) < 3 + 20 * angle
    bent = [*turn[:25], TcpPose(here, turn[25].rotation @ rotation_exp(np.array([5e-3, 0, 0]))), *turn[26:]]
    assert 25 in kept_poses(bent, RESOLUTION)


def test_a_path_that_goes_back_and_forth_on_one_line_keeps_its_turning_points() -> None:
    there, back = np.full(6, 0.4), np.zeros(6)
    assert kept_joints(np.array(3 * [back, there]), Resolution()) == [0, 1, 2, 3, 4, 5]
    assert kept_joints(np.array([back, there, back, there, 2 * there]), Resolution()) == [0, 1, 2, 4]
