"""A robot is one YAML: the planner drives each within the limits that its description gives."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import pytest
import yaml

from rackhand.schemas.chassis import JackRequest
from rackhand.schemas.parameters import ParameterChanges, ParametersRequest, SetParameters
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.sim.world.maps import write_map
from rackhand.worlds.chassis_model import load_profile
from rackhand.worlds.data import WORLDS_PATH
from rackhand.worlds.world_model import World
from tests.joined.world import JoinedWorld

HALL = {
    "version": 1,
    "name": "hall",
    "bounds": [0, 0, 16, 4],
    "robots": {"amr1": {"profile": "longjack", "pose": [1.5, 2.0, 0.0]}},
    "statics": {
        "south": {"kind": "wall", "start": [0, -0.1], "end": [16, -0.1]},
        "east": {"kind": "wall", "start": [16.1, 0], "end": [16.1, 4]},
        "north": {"kind": "wall", "start": [16, 4.1], "end": [0, 4.1]},
        "west": {"kind": "wall", "start": [-0.1, 4], "end": [-0.1, 0]},
    },
}


@pytest.fixture
def worlds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A worlds folder of the user's that holds a hall of 16 x 4 m."""
    folder = tmp_path / "worlds"
    monkeypatch.setenv(WORLDS_PATH, str(folder))
    write_map(World.model_validate(HALL), folder / "hall")
    (folder / "hall" / "world.yaml").write_text(yaml.safe_dump(HALL))
    (folder / "chassis").mkdir()
    return folder


def speeds(world: JoinedWorld) -> list[float]:
    return [message.twist.linear for message in world.chassis().odometry]


@pytest.mark.parametrize(("profile", "least", "most"), [("jackal", 1.95, 2.05), ("longjack", 1.15, 1.23)])
def test_a_straight_of_12_m_is_driven_at_the_speed_of_the_chassis(
    worlds: Path, tmp_path: Path, profile: str, least: float, most: float
) -> None:
    with JoinedWorld("hall", tmp_path, seed=1, profile=profile) as world:
        move = world.chassis().drive(type="standard", target_x=13.5, target_y=2.0, target_ori=0.0, within=60.0)
        assert move.state == "succeeded", move.fail_message
        assert least < max(speeds(world)) < most
        pose = world.true_pose("amr1")
        assert abs(pose.x - 13.5) < 0.04 and abs(pose.y - 2.0) < 0.04 and abs(pose.yaw) < 0.03
        assert world.inspect().contact_count == 0


def test_a_jackal_whose_velocity_is_lowered_on_the_way_drives_on_within_it(worlds: Path, tmp_path: Path) -> None:
    with JoinedWorld("hall", tmp_path, seed=1, profile="jackal") as world:
        chassis = world.chassis()
        move = chassis.post(type="standard", target_x=8.0, target_y=2.0, target_ori=0.0)
        chassis.wait_until_moving(by=1.5)
        assert max(speeds(world)) > 1.0
        changes = ParameterChanges(max_forward_velocity=0.6)
        reply = chassis.core.parameters.answer(ParametersRequest(request=SetParameters(changes=changes)))
        assert (reply.values.max_forward_velocity, reply.defaults.max_forward_velocity) == (0.6, 2.0)
        braked = len(chassis.commands) + 15  # 0.6 s; from 2 m/s at 4 m/s² it takes 0.35 s
        assert chassis.finish(move, within=60.0).state == "succeeded"
        assert 0.58 < max(command.twist.linear for command in chassis.commands[braked:]) <= 0.6


def test_a_chassis_is_added_by_one_yaml(worlds: Path, tmp_path: Path) -> None:
    """A cart of its own size and limits, without a jack: simulator and planner know it by the file alone."""
    cart = load_profile("jackal").model_dump(mode="json")
    cart["name"] = "cart"
    cart["body"] |= {"size": [0.6, 0.5, 0.3], "mass": 25}
    cart["limits"] |= {"forward": 0.7, "acceleration": 0.9}
    (worlds / "chassis" / "cart.yaml").write_text(yaml.safe_dump(cart))
    with JoinedWorld("hall", tmp_path, seed=1, profile="cart") as world:
        chassis = world.chassis()
        assert chassis.drive(type="standard", target_x=6.0, target_y=2.0, within=60.0).state == "succeeded"
        driven = speeds(world)
        assert 0.65 < max(driven) < 0.72
        commanded = [command.twist.linear for command in chassis.commands]
        assert max(b - a for a, b in pairwise(commanded)) == pytest.approx(0.9 * 0.04, rel=0.01)
        assert world.inspect().contact_count == 0
        with pytest.raises(RequestRefused, match="no jack") as refused:
            chassis.ask(JackRequest(direction="up"))
        assert refused.value.code == RefusalCode.PRECONDITION
