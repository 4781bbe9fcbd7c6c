"""Gaps that only the lidar knows are driven like mapped ones: no wavering, no search for another way."""

from __future__ import annotations

from pathlib import Path

import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.world import Place
from rackhand.services.sim.chassis.noise import NoiseSettings
from tests.joined.places import write_place
from tests.joined.test_near_things import HALL, WALLS
from tests.joined.world import JoinedWorld
from tests.system.driving import standard


@pytest.mark.parametrize(
    ("gap", "middle", "way_round", "start", "noise"),
    [(0.6, 0.0, False, 0.3, 1.0), (0.6, 0.0, True, 0.3, 1.0), (0.7, -0.03, False, -0.3, 2.0)],
    ids=["the only way", "or a way round", "from the other side, twice the noise"],
)  # fmt: skip
def test_a_gap_that_no_map_shows_is_driven_through(
    gap: float,
    middle: float,
    way_round: bool,
    start: float,
    noise: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two crates across a hall of 20 x 12 m leave ``gap`` metres; the body is 0.46 m wide."""
    name = write_place(tmp_path / "worlds", monkeypatch, "hall", HALL, WALLS, (-4.0, start, 0.0))
    with JoinedWorld(name, tmp_path, seed=1, noise=NoiseSettings(scale=noise)) as world:
        for side, low, high in (("s", -4.8 if way_round else -6.0, middle - gap / 2), ("n", middle + gap / 2, 6.0)):
            world.ask(Place(name=side, pose=Pose2(x=0.0, y=(low + high) / 2, yaw=0.0), size=(0.6, high - low, 0.6)))
        world.advance(0.4)
        begun, passed = world.now(), []
        driver = world.chassis()
        move = driver.post(standard(4.0, 0.0, 0.0))
        while driver.move(move).state == "moving" and world.now() - begun < 40.0:
            world.advance(0.5)
            pose = world.true_pose("amr1")
            if abs(pose.x) < 0.3:
                passed.append(abs(pose.y - middle))
        assert driver.move(move).state == "succeeded", driver.move(move)
        assert passed and max(passed) < 0.1, "through the gap"
        assert world.inspect().contact_count == 0
