"""Open ground: a lidar that works and sees hardly anything, or nothing, is not blind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.world import InjectFault
from rackhand.testing import distance
from tests.joined.places import write_place
from tests.joined.world import JoinedWorld
from tests.system.driving import standard

PILLARS = {
    "pillar_a": {"kind": "cylinder", "centre": [10, 3], "radius": 0.5, "height": 1.5},
    "pillar_b": {"kind": "cylinder", "centre": [-8, -4], "radius": 0.5, "height": 1.5},
}


@pytest.mark.parametrize(
    ("statics", "profile"),
    [(PILLARS, "longjack"), ({}, "longjack"), ({"pillar_a": PILLARS["pillar_a"] | {"mapped": False}}, "jackal")],
    ids=["two pillars", "nothing at all", "an unmapped pillar"],
)
def test_a_yard_is_driven_through(
    statics: dict[str, Any], profile: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = write_place(tmp_path / "worlds", monkeypatch, "yard", (-28, -28, 28, 28), statics, profile=profile)
    with JoinedWorld(name, tmp_path, seed=1) as world:
        move = world.chassis().drive(standard(5.0, 0.0, 0.0), within=60.0)
        assert move.state == "succeeded", move.fail_message
        assert distance(world.true_pose("amr1"), 5.0, 0.0) < 0.05
        assert world.inspect().contact_count == 0


@pytest.mark.parametrize("fault", ["lidar_blind", "lidar_dead"])
def test_a_lidar_that_fails_there_is_noticed_as_soon_as_elsewhere(
    fault: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = write_place(tmp_path / "worlds", monkeypatch, "yard", (-28, -28, 28, 28))
    with JoinedWorld(name, tmp_path, seed=1) as world:
        driver = world.chassis()
        move = driver.post(standard(20.0, 0.0, 0.0))
        driver.wait_until_moving()
        world.ask(InjectFault(target="amr1", fault=fault))
        begun = world.now()
        ended = driver.finish(move, within=10.0)
        assert (ended.state, ended.fail_reason) == ("failed", MoveFailReason.CONTROL_COSTMAP_ERROR), ended
        assert 5.0 < world.now() - begun < 6.5
