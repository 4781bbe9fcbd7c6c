"""Arms as data: one YAML, one MJCF; a wrong one is refused with what is wrong."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from rackhand.services.controller.ik import forward, load_arm
from rackhand.services.sim.simulation import Simulation
from rackhand.worlds.arm_model import arm_mjcf, known_arms, load_arm_description, load_arm_descriptions, with_arm_kind
from rackhand.worlds.data import WORLDS_PATH, WorldFileError
from rackhand.worlds.world_model import load_world
from tests.sim.helpers import coast, make_world


@pytest.fixture
def arms(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The ``arms`` folder of a worlds folder of the user's."""
    monkeypatch.setenv(WORLDS_PATH, str(tmp_path))
    folder = tmp_path / "arms"
    folder.mkdir()
    return folder


def content(**changes: Any) -> str:
    """The YAML of a UR5e, with changes."""
    return yaml.safe_dump(load_arm_description("ur5e").model_dump(mode="json") | changes)


@pytest.mark.parametrize("name", known_arms())
def test_the_yaml_and_the_mjcf_describe_the_same_arm(name: str) -> None:
    assert len(load_arm_description(name).home) == load_arm(name).n


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"velocity": [1.0, 2.0]}, "velocity has 2 values, but home has 6"),
        ({"jerk": [1.0] * 5 + [-1.0]}, "jerk.5: Input should be greater than 0"),
        ({"acceleration": [1.0] * 5 + [float("nan")]}, "acceleration.5: Input should be a finite number"),
        ({"task_velocity": [1.0]}, "task_velocity.1: Field required"),
        ({"self_collision": [["base", "elbo"]]}, "self_collision: 'elbo' is not a sphere; expected one of ['base',"),
        (
            {"spheres": [{"name": "s", "body": "b", "at": [0, 0, 0], "radius": 1}] * 2},
            "spheres: 's' is used twice",
        ),
        ({"speed": 1}, "unknown key 'speed'; known: ['acceleration',"),
    ],
)
def test_a_wrong_description_says_file_place_and_what(arms: Path, change: dict[str, Any], told: str) -> None:
    (arms / "mine.yaml").write_text(content(**change))
    with pytest.raises(WorldFileError) as error:
        load_arm_description("mine")
    assert told in str(error.value) and str(arms / "mine.yaml") in str(error.value)


def test_an_arm_without_its_mjcf_is_refused(arms: Path) -> None:
    (arms / "mine.yaml").write_text(content())
    with pytest.raises(WorldFileError, match=r"mine\.xml: is missing"):
        arm_mjcf("mine")


def test_an_unknown_arm_names_the_place_and_the_known() -> None:
    world = make_world(arms={"arm1": {"kind": "ur6", "pose": (3, 0, 0)}})
    with pytest.raises(WorldFileError, match=r"arms\.arm1\.kind: .*'ur6'.*\['fr3', 'ur5e'\]"):
        load_arm_descriptions(world)


def test_a_home_of_the_world_has_one_value_per_joint() -> None:
    world = make_world(arms={"arm1": {"kind": "ur5e", "pose": (3, 0, 0), "home": (0.0,) * 7}})
    with pytest.raises(WorldFileError, match=r"arms\.arm1\.home: 7 values, but ur5e has 6 joints"):
        load_arm_descriptions(world)


def test_an_arm_is_added_by_a_yaml_and_its_mjcf(arms: Path) -> None:
    """The controller's model and the simulator read the same two files."""
    home = [0.3, -1.2, 1.4, -1.6, -1.5, 0.2]
    (arms / "ur5e_slow.yaml").write_text(content(home=home, velocity=[0.5] * 6))
    shutil.copy(arm_mjcf("ur5e"), arms / "ur5e_slow.xml")
    model = load_arm("ur5e_slow")
    assert model.limits.velocity.tolist() == [0.5] * 6 and model.home.tolist() == home
    world = make_world(robots={}, arms={"arm1": {"kind": "ur5e_slow", "pose": (0, 0, 0), "mount": 0.6}})
    simulation = Simulation(world, {}, seed=0)
    coast(simulation, 0.2)
    assert simulation.arms["arm1"].state(simulation.stamp).q == pytest.approx(home, abs=1e-3)
    flange = simulation.data.site("arm1/flange").xpos - (0, 0, 0.6)
    np.testing.assert_allclose(forward(model, np.array(home))[:, 3], flange, atol=2e-3)


def test_another_kind_of_arm_begins_at_its_own_home() -> None:
    world = load_world("pick_station")
    place = world.arms["arm1"].model_copy(update={"home": load_arm_description("ur5e").home})
    world = world.model_copy(update={"arms": {"arm1": place}})
    assert with_arm_kind(world, None) is world
    assert with_arm_kind(world, "ur5e").arms["arm1"] == place
    other = with_arm_kind(world, "fr3")
    assert (other.arms["arm1"].kind, other.arms["arm1"].home, other.arms["arm1"].pose) == ("fr3", None, place.pose)
    assert len(load_arm_descriptions(other)["arm1"].home) == 7
