"""Tests of ``mover.py`` against a whole simulated cell: ``pip install rackhand[testing]``, then ``pytest``."""

import mover
import pytest

from rackhand.testing import distance


def test_it_drives_to_the_point(cell):
    assert mover.drive(cell.http, 4.5, 1.5) == 1
    assert distance(cell.true_pose("amr1"), 4.5, 1.5) < 0.05, "ground truth, not what the robot believes"
    assert cell.contacts() == ()


def test_it_tries_again_when_the_lidar_was_blind_for_a_while(cell, world):
    world.fault("lidar_dead", "amr1")

    def wait(seconds):
        world.clear("lidar_dead", "amr1")
        world.advance(seconds)
        world.resume()

    assert mover.drive(cell.http, 4.5, 1.5, wait) == 2
    assert distance(world.true_pose("amr1"), 4.5, 1.5) < 0.05


def test_it_gives_up_and_says_why_when_the_lidar_stays_dead(cell, world):
    world.fault("lidar_dead", "amr1")
    with pytest.raises(mover.NotReached, match="scan"):
        mover.drive(cell.http, 4.5, 1.5, wait=lambda _seconds: None)
    assert distance(world.true_pose("amr1"), 2.5, 1.5) < 0.5, "without a lidar it stops where it is"
