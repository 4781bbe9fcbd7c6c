"""The joined cell itself: it drives, it picks, and two runs of one seed are the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rackhand.schemas.world import Reset
from tests.joined.world import JoinedWorld


def test_a_move_and_a_path_at_the_same_time(tmp_path: Path) -> None:
    with JoinedWorld("warehouse", tmp_path, seed=3) as world:
        chassis, arm = world.chassis(), world.arm()
        start = world.true_pose("amr1")
        move = chassis.post(type="standard", target_x=start.x + 1.5, target_y=start.y)
        goal = arm.arm.home + np.array([0.2, 0.1, 0.0, 0.0, 0.0, 0.0])
        arm.ok(command="appendPath", type="joints", data=[goal.tolist()])
        assert chassis.finish(move).state == "succeeded"
        pose = world.true_pose("amr1")
        assert abs(pose.x - start.x - 1.5) < 0.05
        assert np.abs(np.array(arm.states[-1].q) - goal).max() < 1e-3
        assert world.inspect().contact_count == 0


def test_the_same_seed_gives_the_same_run(tmp_path: Path) -> None:
    with JoinedWorld("warehouse", tmp_path, seed=3, with_arms=False) as world:
        digests = []
        for seed in (5, 5, 6):
            world.ask(Reset(seed=seed))
            world.chassis().post(type="standard", target_x=5.5, target_y=7.5)
            digests.append(world.advance(4.0).digest)
    assert digests[0] == digests[1] != digests[2]
