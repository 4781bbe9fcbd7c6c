"""Scenario files: what is refused, how they are found, and that all that come with rackhand fit their worlds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.worlds.data import WORLDS_PATH, WorldFileError
from rackhand.worlds.scenario_check import problems_of
from rackhand.worlds.scenario_model import (
    Scenario,
    installed_scenarios,
    known_scenarios,
    load_scenarios,
    read_scenario,
)
from rackhand.worlds.world_model import load_world

GOOD: dict[str, Any] = {
    "name": "gone",
    "shows": "A rack that is not there.",
    "world": "warehouse",
    "start": [7.8, 7.4, 1.57],
    "timeline": [{"remove": ["rack_s8"], "move": {"type": "align_with_rack", "target_x": 7.8, "target_y": 9.4}}],
    "expect": {"state": "failed", "reason": "rack_detection_error", "within": 40},
    "then": {"type": "standard", "target_x": 7.0, "target_y": 7.4},
}


def problems(**changes: Any) -> tuple[str, ...]:
    return problems_of(Scenario.model_validate(GOOD | changes), load_world("warehouse"))


def write(folder: Path, content: dict[str, Any], name: str = "gone") -> Path:
    path = folder / "warehouse" / "scenarios" / f"{name}.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(yaml.safe_dump(content))
    return path


def test_a_reason_is_given_by_its_name_or_its_number() -> None:
    assert Scenario.model_validate(GOOD).expect.reason is Reason.RACK_DETECTION_ERROR
    numbered = GOOD | {"expect": GOOD["expect"] | {"reason": 501}}
    assert Scenario.model_validate(numbered).expect.reason is Reason.RACK_DETECTION_ERROR


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"timeline": []}, "timeline"),
        ({"timeline": [{"remove": ["rack_s8"]}]}, "no step requests a move"),
        ({"timeline": [{"when": {"after": 1.0}}]}, "a step without an action"),
        ({"timeline": [{"moves": {}}]}, "unknown key 'moves'"),
        ({"timeline": [{"faults": [{"fault": "lidar_ded"}], "move": {}}]}, "fault 'lidar_ded' is not known"),
        ({"expect": {"state": "failed", "reason": "no_rack", "within": 1}}, "'no_rack' is not a MoveFailReason"),
        ({"expect": {"state": "failed", "within": 1}}, "a reason is of failed moves only"),
        ({"then": None}, "needs a move that succeeds after it"),
    ],
)
def test_what_makes_no_scenario_is_refused_with_its_place(tmp_path: Path, changes: dict[str, Any], text: str) -> None:
    path = write(tmp_path, GOOD | changes)
    with pytest.raises(WorldFileError) as error:
        read_scenario(path)
    assert text in str(error.value) and str(path) in str(error.value)


def test_name_and_world_are_those_of_file_and_folder(tmp_path: Path) -> None:
    with pytest.raises(WorldFileError, match="want that of the file, 'other'"):
        read_scenario(write(tmp_path, GOOD, "other"))
    with pytest.raises(WorldFileError, match="want that of the folder, 'warehouse'"):
        read_scenario(write(tmp_path, GOOD | {"world": "empty"}))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"robot": "amr9"}, "robot 'amr9' is not in world warehouse"),
        ({"start": [99.0, 7.4, 0.0]}, "start (99, 7.4) is in no hall"),
        ({"timeline": [{"remove": ["rack_s9"], "move": {}}]}, "timeline 1: remove: 'rack_s9'"),
        ({"timeline": [{"put": {"rack_s9": [1, 1, 0]}, "move": {}}]}, "timeline 1: put: 'rack_s9'"),
        ({"timeline": [{"move": {"type": "fly"}}]}, "timeline 1: move: type"),
        ({"timeline": [{"faults": [{"fault": "leg_hidden"}], "move": {}}]}, "'amr1' is no rack of world warehouse"),
        (
            {"timeline": [{"faults": [{"fault": "leg_hidden", "target": "rack_s8", "part": 4}], "move": {}}]},
            "fault leg_hidden has no part 4",
        ),
        ({"timeline": [{"faults": [{"fault": "kidnapped"}], "move": {}}]}, "kidnapped: needs a pose (at)"),
        ({"timeline": [{"faults": [{"fault": "lidar_noisy", "amount": 9.0}], "move": {}}]}, "want 0 … 5"),
        ({"mend": [{"remove": ["crate"]}]}, "mend 1: remove: 'crate'"),
        ({"then": {"type": "standard", "target_x": "far"}}, "then: move: target_x"),
    ],
)
def test_what_does_not_fit_the_world_is_a_problem(changes: dict[str, Any], text: str) -> None:
    assert problems() == ()
    (problem,) = problems(**changes)
    assert problem.startswith("gone: ") and text in problem


def test_what_was_placed_can_be_removed() -> None:
    steps = [{"place": {"crate": {"at": [5, 5, 0]}}, "move": {}}, {"remove": ["crate"]}]
    assert problems(timeline=steps) == ()


def test_scenarios_of_further_worlds_folders_are_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, GOOD)
    monkeypatch.setenv(WORLDS_PATH, str(tmp_path))
    assert known_scenarios()["gone"].is_relative_to(tmp_path) and "gone" not in installed_scenarios()
    assert [scenario.name for scenario in load_scenarios(["gone", "gone"])] == ["gone"]
    assert {scenario.world for scenario in load_scenarios(["empty"])} == {"empty"}
    with pytest.raises(WorldFileError, match="there is no scenario or world 'nothing'"):
        load_scenarios(["nothing"])


@pytest.mark.parametrize("name", installed_scenarios())
def test_those_that_come_with_rackhand_fit_their_worlds(name: str) -> None:
    scenario = read_scenario(installed_scenarios()[name])
    assert problems_of(scenario, load_world(scenario.world)) == ()


@pytest.mark.parametrize("name", installed_scenarios())
def test_those_that_fail_say_what_explain_must_name(name: str) -> None:
    expect = read_scenario(installed_scenarios()[name]).expect
    named = expect.explain
    assert expect.state == "succeeded" or (named is not None and (named.words or named.things or named.measures))
