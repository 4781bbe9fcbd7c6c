"""Worlds as data: those that come along are good, and a wrong one is told where, what, and what is known."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from rackhand.services.sim.simulation import Simulation
from rackhand.worlds.chassis_model import load_profiles
from rackhand.worlds.data import WorldFileError
from rackhand.worlds.world_model import known_worlds, load_world, world_directory
from tests.sim.helpers import coast, make_simulation, make_world

GOOD: dict[str, Any] = {
    "version": 1,
    "name": "mine",
    "bounds": [0, 0, 5, 5],
    "robots": {"amr1": {"profile": "longjack", "pose": [1, 1, 0]}},
    "statics": {
        "wall_a": {"kind": "wall", "start": [0, 0], "end": [5, 0]},
        "table": {"kind": "box", "pose": [4, 4, 0.3], "size": [1, 0.8, 0.6], "z": 0.1},
    },
    "rack_kinds": {"standard": {"size": [1, 1], "underside": 0.3, "height": 1.0, "mass": 50}},
    "racks": {"a1": {"kind": "standard", "pose": [3, 3, 0]}},
    "items": {
        "tin": {"size": [0.2, 0.1, 0.1], "pose": [4.2, 4.3, 1], "lies_on": "table"},
        "bag": {"size": [0.2, 0.3, 0.1], "pose": [3.2, 3, 0], "lies_on": "a1", "mass": 2},
        "brick": {"size": [0.2, 0.1, 0.05], "pose": [1, 3, 0], "z": 0.5},
    },
    "movers": {"anna": {"motion": {"kind": "walk", "points": [[2, 4], [3, 4]]}}},
}


def write(folder: Path, content: Any) -> str:
    (folder / "world.yaml").write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    return str(folder)


def changed(change: Callable[[Any], Any]) -> Any:
    content = json.loads(json.dumps(GOOD))
    change(content)
    return content


@pytest.mark.parametrize("name", known_worlds())
def test_worlds_that_come_along_run(name: str) -> None:
    world = load_world(name)
    assert world.name == name
    simulation = Simulation(world, load_profiles(world), world.seed)
    simulation.step()
    assert simulation.contact_log.count == 0


def test_a_world_may_be_given_by_its_folder(tmp_path: Path) -> None:
    assert load_world(write(tmp_path, GOOD)).name == "mine"


def test_items_lie_where_the_file_says_and_are_reported_of(tmp_path: Path) -> None:
    simulation = make_simulation(load_world(write(tmp_path, GOOD)))
    coast(simulation, 1.0)
    model, data = simulation.model, simulation.data
    undersides = {name: float(data.body(name).xpos[2]) - size / 2 for name, size in
                  (("tin", 0.1), ("bag", 0.1), ("brick", 0.05))}  # fmt: skip
    assert undersides == pytest.approx({"tin": 0.7, "bag": 1.0, "brick": 0.0}, abs=1e-3), "the brick has fallen"
    assert not data.body_awake[[model.body(name).id for name in ("tin", "bag")]].any(), "what lies still sleeps"
    assert {"tin", "bag", "brick"} <= {pose.name for pose in simulation.objects().objects}
    assert {"tin", "bag", "brick"} <= {geom.body for geom in simulation.scene().geoms}
    assert data.body("bag").xpos[:2] == pytest.approx([3.2, 3.0], abs=1e-3)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            lambda w: w["movers"]["anna"]["motion"].update(spede=2),
            "movers.anna.motion.walk: unknown key 'spede'; known: [",
        ),
        (
            lambda w: w["racks"]["a1"].update(kind="standrad"),
            "rack 'a1' is of unknown kind 'standrad'; known: ['standard']",
        ),
        (lambda w: w["statics"]["wall_a"].update(kind="wal"), "'wall', 'box', 'cylinder'"),
        (lambda w: w["statics"]["wall_a"].update(end=[0, 0]), "statics.wall_a.wall: start and end are both"),
        (lambda w: w["robots"]["amr1"].update(pose=[1, 1]), "robots.amr1.pose"),
        (lambda w: w["robots"]["amr1"].update(battery=80), "robots.amr1.battery"),
        (lambda w: w["robots"]["amr1"].update(pose=[1, float("nan"), 0]), "robots.amr1.pose.1"),
        (lambda w: w.update(robots={}), "robots"),
        (lambda w: w.update(robots={"AMR 1": GOOD["robots"]["amr1"]}), "robots.AMR 1"),
        (lambda w: w.update(version=2), "version"),
        (lambda w: w.update(bounds=[5, 0, 0, 5]), "want x_min, y_min, x_max, y_max"),
        (lambda w: w.update(timestep=0.003), "a whole number of steps"),
        (lambda w: w["movers"].update(a1=w["movers"]["anna"]), "the name 'a1' is used in racks and in movers"),
        (lambda w: w["items"]["tin"].update(mass=0), "items.tin.mass: Input should be greater than 0"),
        (lambda w: w["items"]["tin"].update(z=1.0), "items.tin: lies_on 'table' and z 1: want one of the two"),
        (
            lambda w: w["items"]["tin"].update(lies_on="wall_a"),
            "items.tin.lies_on: 'wall_a' is neither a box nor a rack",
        ),
        (lambda w: w["items"]["tin"].update(pose=[4, 3.4, 0]), "items.tin.pose: its centre is not above table, which"),
        (lambda w: w["items"].update(a1=w["items"]["tin"]), "the name 'a1' is used in racks and in items"),
        (lambda w: w.pop("bounds"), "bounds: Field required"),
    ],
)
def test_a_wrong_world_file_is_reported_where_and_what(tmp_path: Path, change: Callable[[Any], Any], told: str) -> None:
    with pytest.raises(WorldFileError) as error:
        load_world(write(tmp_path, changed(change)))
    assert told in str(error.value) and str(tmp_path / "world.yaml") in str(error.value)


@pytest.mark.parametrize(("text", "told"), [("{", "not YAML"), ("- a", "the file"), ("", "the file")])
def test_what_is_no_world_at_all_is_reported(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(WorldFileError, match=told):
        load_world(write(tmp_path, text))


def test_an_unknown_world_names_those_that_are() -> None:
    with pytest.raises(WorldFileError, match="is neither a world \\(empty, pick_station, warehouse\\) nor a folder"):
        load_world("wharehouse")


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ({"statics": {"box_a": {"kind": "box", "pose": (0, 0, 0), "size": (1, 1, 1)}}}, "amr1.pose.*overlap 'box_a'"),
        ({"obstacles": {"c": {"kind": "box", "pose": (3, 0, 0), "size": (1, 1)}}}, "want l, w, h"),
        ({"movers": {"a": {"motion": {"kind": "walk", "points": [(2, 2), (2, 2)]}}}}, "a walk needs two points"),
    ],
)
def test_a_world_that_cannot_stand_is_reported(parts: Any, told: str) -> None:
    with pytest.raises(WorldFileError, match=told):
        make_simulation(make_world(**parts))


def test_overlays_of_the_warehouse_agree_with_its_world() -> None:
    world = load_world("warehouse")
    features = json.loads((world_directory("warehouse") / "overlays.geojson").read_text())["features"]
    assert len({f["id"] for f in features}) == len(features)
    points = {
        f["properties"].get("name"): f["geometry"]["coordinates"] for f in features if f["geometry"]["type"] == "Point"
    }
    for name, rack in world.racks.items():
        assert tuple(points[name.removeprefix("rack_")]) == rack.pose[:2]
    assert tuple(points["Charging Station"]) == world.chargers["charger_1"].dock[:2]
    kinds = {str(f["properties"].get(k)) for f in features for k in ("regionType", "lineType", "type")}
    assert {"1", "2", "17", "34", "9", "36", "6"} <= kinds


FLOORS = {"floor2": {"bounds": (40, 0, 50, 10)}}


@pytest.mark.parametrize(
    ("floors", "error"),
    [
        ({"floor1": (0, 0, 0), "floor3": (40, 0, 0)}, r"lifts\.lift_1\.floors: \['floor3'\] are not known; known: "),
        ({"floor1": (0, 0, 0), "floor2": (40, 0, 1)}, r"floors: yaws \[0\.0, 1\.0\]: want the same yaw on all floors"),
        ({"floor1": (0, 0, 0)}, "at least 2 items"),
    ],
)
def test_a_lift_goes_straight_between_floors_that_exist(floors: Any, error: str) -> None:
    lift = {"floors": floors, "cabin": (2, 2), "door": 1.2, "door_at": 1.1}
    with pytest.raises(ValidationError, match=error):
        make_world(floors=FLOORS, lifts={"lift_1": lift})


def test_floors_have_bounds_and_maps_of_their_own() -> None:
    world = make_world(floors=FLOORS)
    assert list(world.bounds_of_floors) == ["floor1", "floor2"]
    assert (world.map_name("floor1"), world.map_name("floor2")) == ("test", "test_floor2")
    with pytest.raises(ValidationError, match=r"bounds .* of floor2: want x_min"):
        make_world(floors={"floor2": {"bounds": (50, 0, 40, 10)}})
