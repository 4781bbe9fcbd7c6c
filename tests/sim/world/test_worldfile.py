"""Worlds as data: those that come along are good, and a wrong one is told where, what, and what is known."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image
from typer.testing import CliRunner

from rackhand.services.sim.__main__ import app
from rackhand.services.sim.chassis.profiles import known_profiles, load_profile, load_profiles
from rackhand.services.sim.errors import WorldFileError
from rackhand.services.sim.simulation import Simulation
from rackhand.services.sim.world import maps
from rackhand.services.sim.world.barn import read_barn, write_barn_world
from rackhand.services.sim.world.worldfile import known_worlds, load_world, world_directory, worlds_root
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


def test_items_lie_where_the_file_says_and_are_told_of(tmp_path: Path) -> None:
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
            "items.tin.lies_on: 'wall_a' is no box and no rack",
        ),
        (lambda w: w["items"]["tin"].update(pose=[4, 3.4, 0]), "items.tin.pose: its middle is not over table, which"),
        (lambda w: w["items"].update(a1=w["items"]["tin"]), "the name 'a1' is used in racks and in items"),
        (lambda w: w.pop("bounds"), "bounds: Field required"),
    ],
)
def test_a_wrong_world_file_is_told_where_and_what(tmp_path: Path, change: Callable[[Any], Any], told: str) -> None:
    with pytest.raises(WorldFileError) as error:
        load_world(write(tmp_path, changed(change)))
    assert told in str(error.value) and str(tmp_path / "world.yaml") in str(error.value)


@pytest.mark.parametrize(("text", "told"), [("{", "not YAML"), ("- a", "the file"), ("", "the file")])
def test_what_is_no_world_at_all_is_told(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(WorldFileError, match=told):
        load_world(write(tmp_path, text))


def test_an_unknown_world_names_those_that_are() -> None:
    with pytest.raises(WorldFileError, match="is neither a world \\(empty, pick_station, warehouse\\) nor a folder"):
        load_world("wharehouse")


def test_an_unknown_profile_names_the_robot_and_those_that_are() -> None:
    world = make_world(robots={"amr1": {"profile": "longjak", "pose": (0, 0, 0)}})
    with pytest.raises(WorldFileError, match=r"robots\.amr1\.profile: .*'longjak'.*\['jackal', 'longjack'\]"):
        load_profiles(world)


@pytest.mark.parametrize(
    ("parts", "told"),
    [
        ({"statics": {"box_a": {"kind": "box", "pose": (0, 0, 0), "size": (1, 1, 1)}}}, "amr1.pose.*stand in 'box_a'"),
        ({"obstacles": {"c": {"kind": "box", "pose": (3, 0, 0), "size": (1, 1)}}}, "want l, w, h"),
        ({"movers": {"a": {"motion": {"kind": "walk", "points": [(2, 2), (2, 2)]}}}}, "a walk needs two points"),
    ],
)
def test_a_world_that_cannot_stand_is_told(parts: Any, told: str) -> None:
    with pytest.raises(WorldFileError, match=told):
        make_simulation(make_world(**parts))


@pytest.mark.parametrize("name", known_profiles())
def test_profiles_are_low_and_their_servos_do_not_chatter(name: str) -> None:
    profile = load_profile(name)
    assert profile.body.clearance + profile.body.size[2] < 0.27
    assert profile.drive.gain * 0.002 < profile.drive.rotor_inertia
    length, width, _ = profile.body.size
    np.testing.assert_allclose(np.ptp(profile.footprint, axis=0), [length, width])
    x, y = profile.footprint.T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0, "counter-clockwise"


# -- maps --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", known_worlds())
def test_the_committed_map_is_that_of_the_world(name: str) -> None:
    world, folder = load_world(name), world_directory(name)
    with Image.open(folder / "map.png") as image:
        np.testing.assert_array_equal(np.asarray(image), maps.draw(world))
    assert yaml.safe_load((folder / "map.yaml").read_text()) == maps.description(world)


def cell(world: Any, x: float, y: float) -> int:
    left, bottom = maps.map_origin(world)
    resolution = world.map.resolution
    return int(maps.draw(world)[::-1][int((y - bottom) / resolution), int((x - left) / resolution)])


def test_a_map_shows_what_stands_still_in_the_plane_of_the_lidar() -> None:
    world = make_world(
        statics={
            "low": {"kind": "box", "pose": (1, 0, 0), "size": (0.5, 0.5, 0.1)},
            "high": {"kind": "box", "pose": (3, 0, 0), "size": (0.5, 0.5, 1), "z": 0.5},
            "cut": {"kind": "box", "pose": (5, 0, 0.785), "size": (1, 0.2, 1)},
            "secret": {"kind": "cylinder", "centre": (7, 0), "radius": 0.3, "height": 1, "mapped": False},
        },
        rack_kinds={"standard": {"size": (1, 1), "underside": 0.3, "height": 1.0, "mass": 50}},
        racks={"a1": {"kind": "standard", "pose": (3, 5, 0)}},
        movers={"anna": {"motion": {"kind": "stand", "pose": (5, 5, 0)}}},
        chargers={"dock": {"pose": (-9, 0, 0), "dock": (-8, 0, 0)}},
    )
    assert cell(world, 1.0, 0.0) == cell(world, 3.0, 0.0) == cell(world, 7.0, 0.0) == maps.FREE
    assert cell(world, 5.3, 0.3) == maps.OCCUPIED and cell(world, 5.3, -0.3) == maps.FREE
    assert cell(world, 3.48, 5.48) == cell(world, 5.0, 5.0) == maps.FREE
    assert cell(world, -9.0, 0.0) == maps.OCCUPIED
    assert cell(world, -10.3, 0.0) == maps.UNKNOWN


def test_the_map_agrees_with_the_physics() -> None:
    """Every beam of the warehouse's first scan that hits a static ends in or beside an occupied cell."""
    world = load_world("warehouse").model_copy(update={"racks": {}, "movers": {}})
    simulation = make_simulation(world)
    scan = next(o.message for o in simulation.outputs if o.topic.name == "chassis/scan")
    x, y, yaw = simulation.robots["amr1"].pose
    angles = scan.angle_min + scan.angle_step * np.arange(len(scan.ranges)) + yaw
    ranges = scan.ranges + 1e-3
    columns = ((x + scan.sensor.x + ranges * np.cos(angles) + 0.5) / 0.05).astype(int)
    rows = ((y + ranges * np.sin(angles) + 0.5) / 0.05).astype(int)
    assert (maps.draw(world)[::-1][rows, columns] == maps.OCCUPIED).mean() > 0.99


# -- worlds from data --------------------------------------------------------------------------------------------------

BARN = {
    "meta": {
        "source": "somewhere",
        "cylinder_radius": 0.075,
        "cylinder_height": 1.0,
        "start": [-2.25, 3, 1.5708],
        "goal": [-2.25, 13],
        "goal_radius": 1.0,
        "timeout": 100,
        "robot": "Jackal",
    },
    "worlds": {
        "1": {"cylinders": [[-4.4, 5.0], [-1.0, 9.0]], "path_length": 12.4},
        "2": {"cylinders": [], "path_length": 1},
    },
}


def test_a_barn_world_has_its_cylinders_a_jackal_and_an_empty_map(tmp_path: Path) -> None:
    file = tmp_path / "worlds.json"
    file.write_text(json.dumps(BARN))
    write_barn_world(file, "1", tmp_path / "barn_1")
    world = load_world(str(tmp_path / "barn_1"))
    assert world == read_barn(file, "1")
    assert world.robots["amr1"].profile == "jackal" and world.robots["amr1"].pose == (-2.25, 3, 1.5708)
    assert world.task is not None and world.task.goal == (-2.25, 13) and len(world.statics) == 2
    with Image.open(tmp_path / "barn_1" / "map.png") as image:
        grid = np.asarray(image)
    assert maps.OCCUPIED not in grid and (grid == maps.FREE).any()
    simulation = make_simulation(world)
    scan = next(o.message for o in simulation.outputs if o.topic.name == "chassis/scan")
    assert np.nanmin(scan.ranges) == pytest.approx(np.hypot(2.15, 2.0 - 0.12) - 0.075, abs=0.01)


@pytest.mark.parametrize(
    ("content", "number", "told"),
    [
        ("{", "1", "not JSON"),
        ("[]", "1", "the file"),
        (json.dumps(BARN), "7", "no world '7'; there are 2, 1 … 2"),
        (json.dumps(BARN), "2", "cylinders"),
        (json.dumps({"worlds": {}}), "1", "meta"),
    ],
)
def test_wrong_barn_data_is_told(tmp_path: Path, content: str, number: str, told: str) -> None:
    file = tmp_path / "worlds.json"
    file.write_text(content)
    with pytest.raises(WorldFileError, match=told):
        read_barn(file, number)


# -- the command line --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--world", "nowhere"], "'nowhere' is neither a world"),
        (["--speed", "fast"], "or max"),
        (["--speed", "0"], "above 0"),
        (["--wait-for", "planner"], "want ROBOT/SERVICE"),
        (["--wait-for", "amr7/planner"], "robots of warehouse: ['amr1', 'arm1']"),
        (["--profile", "tank"], "known: ['jackal', 'longjack']"),
        (["map", "nowhere"], "'nowhere' is neither a world"),
        (["from-barn", "no.json", "1", "out"], "no.json: cannot be read"),
    ],
)
def test_wrong_options_end_with_status_2_and_say_why(arguments: list[str], told: str) -> None:
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert told in " ".join(result.output.replace("│", " ").split())


def test_map_writes_where_it_is_told(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["map", "warehouse", "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert (tmp_path / "map.png").read_bytes() == (worlds_root() / "warehouse" / "map.png").read_bytes()


# -- overlays ----------------------------------------------------------------------------------------------------------


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
