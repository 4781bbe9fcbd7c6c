"""Chassis as data: those that come along are sound, and a wrong one is refused with what is wrong."""

from __future__ import annotations

import numpy as np
import pytest

from rackhand.worlds.chassis_model import known_profiles, load_profile, load_profiles
from rackhand.worlds.data import WorldFileError
from tests.sim.helpers import make_world


def test_an_unknown_profile_names_the_robot_and_those_that_are() -> None:
    world = make_world(robots={"amr1": {"profile": "longjak", "pose": (0, 0, 0)}})
    with pytest.raises(WorldFileError, match=r"robots\.amr1\.profile: .*'longjak'.*\['jackal', 'longjack'\]"):
        load_profiles(world)


@pytest.mark.parametrize("name", known_profiles())
def test_profiles_are_low_and_their_servos_do_not_chatter(name: str) -> None:
    profile = load_profile(name)
    assert profile.body.clearance + profile.body.size[2] < 0.27
    assert profile.drive.gain * 0.002 < profile.drive.rotor_inertia
    length, width, _ = profile.body.size
    np.testing.assert_allclose(np.ptp(profile.footprint, axis=0), [length, width])
    x, y = profile.footprint.T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0, "counter-clockwise"
