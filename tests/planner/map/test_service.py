"""The map store: what is kept, what the robot drives by, and what is refused and why."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from rackhand.schemas import topics
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.maps import DeleteMap, GetMap, ListMaps, MapData, PatchMap, ReplaceMap, SelectMap, UseMapData
from rackhand.schemas.refusal import RequestRefused
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.map.directory import read_map_directory
from tests.planner.fakes import UNIX_NS, Cell, a_map, png
from tests.planner.map.test_directory import write_world

WALL = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "id": "a",
            "properties": {"lineType": "2", "yaw": 30},
            "geometry": {"type": "LineString", "coordinates": [[0, 0], [1, 1.5]]},
        }
    ],
}


def feature(geometry: Any, properties: Any = None) -> dict[str, Any]:
    return {
        "type": "FeatureCollection",
        "features": [{"type": "Feature", "properties": properties, "geometry": geometry}],
    }


def data_of(cell: Cell, request: Any) -> MapData:
    data = cell.ask_maps(request).data
    assert data is not None
    return data


def test_create_get_list_delete(cell: Cell) -> None:
    created = data_of(cell, a_map("second", overlays=WALL))
    assert (created.id, created.map_name, created.overlays) == (2, "second", WALL)
    assert created.create_time == created.last_modified_time == UNIX_NS // 10**9
    assert data_of(cell, GetMap(id=2)) == created
    rows = cell.ask_maps(ListMaps()).maps
    assert [(row.id, row.map_name) for row in rows] == [(1, "hall"), (2, "second")]
    assert rows[0].uid != rows[1].uid
    cell.ask_maps(DeleteMap(id=2))
    assert [row.id for row in cell.ask_maps(ListMaps()).maps] == [1]
    assert data_of(cell, a_map("third")).id == 3, "ids are never used twice"


@pytest.mark.parametrize(
    "request_",
    [
        GetMap(id=9),
        PatchMap(id=9),
        ReplaceMap(id=9, map=a_map("x")),
        DeleteMap(id=9),
        SelectMap(id=9),
        GetMap(id=2**70),
    ],
)
def test_an_unknown_map_is_not_found(cell: Cell, request_: Any) -> None:
    with pytest.raises(RequestRefused, match="there is no map") as refused:
        cell.ask_maps(request_)
    assert refused.value.code == "not_found"


def test_a_patch_waits_for_the_next_selection(cell: Cell) -> None:
    cell.stamp = 5 * 10**9
    cell.tick()
    patched = data_of(cell, PatchMap(id=1, map_name="new name", overlays=WALL))
    assert (patched.map_name, patched.overlays_version) == ("new name", 1)
    assert (patched.create_time, patched.last_modified_time) == (0, UNIX_NS // 10**9 + 5)
    running = data_of(cell, GetMap())
    assert (running.map_name, running.overlays_version) == ("hall", 0)
    assert cell.motion.map == running
    assert len(cell.heard(topics.MAP)) == 1
    cell.ask_maps(SelectMap(id=1))
    assert data_of(cell, GetMap()) == patched == cell.motion.map == cell.heard(topics.MAP)[-1].map


def test_a_map_is_overwritten_whole_and_keeps_what_names_it(cell: Cell) -> None:
    first = data_of(cell, GetMap(id=1))
    cell.stamp = 5 * 10**9
    cell.tick()
    whole = a_map("whole", overlays=WALL, map_version=4, overlays_version=9)
    written = data_of(cell, ReplaceMap(id=1, map=whole))
    assert (written.id, written.uid, written.create_time) == (1, first.uid, first.create_time)
    assert (written.map_name, written.overlays, written.map_version, written.overlays_version) == ("whole", WALL, 4, 9)
    assert written.last_modified_time == UNIX_NS // 10**9 + 5
    assert data_of(cell, GetMap(id=1)) == written
    assert data_of(cell, GetMap()) == first, "the map in use stays as it is"
    cell.ask_maps(a_map("second", uid="abc"))
    with pytest.raises(RequestRefused, match="uid: 'abc' is already that of map 2"):
        cell.ask_maps(ReplaceMap(id=1, map=a_map("whole", uid="abc")))
    assert data_of(cell, ReplaceMap(id=2, map=a_map("again", uid="abc"))).map_name == "again"


def test_an_overwritten_map_survives_a_restart_with_its_image(make_cell: Callable[..., Cell], tmp_path: Path) -> None:
    cell = make_cell(path=tmp_path / "s.sqlite")
    written = data_of(cell, ReplaceMap(id=1, map=a_map("whole").model_copy(update={"png": png(size=(7, 5))})))
    cell.database.close()
    assert data_of(make_cell(path=tmp_path / "s.sqlite", with_map=False), GetMap(id=1)) == written


def test_versions_are_kept_as_given_and_counted_on_otherwise(cell: Cell) -> None:
    created = data_of(cell, a_map("second", map_version=3, overlays_version=7))
    assert (created.map_version, created.overlays_version) == (3, 7)
    assert data_of(cell, PatchMap(id=2, overlays=WALL)).overlays_version == 8
    patched = data_of(cell, PatchMap(id=2, overlays=WALL, overlays_version=40, map_version=5))
    assert (patched.map_version, patched.overlays_version) == (5, 40)


def test_a_patch_does_not_touch_a_running_move(cell: Cell) -> None:
    move = cell.create()
    cell.tick()
    cell.ask_maps(PatchMap(id=1, overlays=WALL))
    cell.ask_maps(DeleteMap(id=1))
    cell.tick()
    assert cell.get(move.id).state == "moving"


def test_select_by_uid_and_clear(cell: Cell) -> None:
    second = data_of(cell, a_map("second", uid="abc"))
    assert data_of(cell, SelectMap(uid="abc")) == second
    with pytest.raises(RequestRefused, match="map 1 has the uid"):
        cell.ask_maps(SelectMap(id=1, uid="abc"))
    assert data_of(cell, GetMap()) == second
    assert cell.ask_maps(SelectMap()).data is None
    assert cell.motion.map is None
    assert cell.heard(topics.MAP)[-1].map is None
    with pytest.raises(RequestRefused, match="no map is in use") as refused:
        cell.ask_maps(GetMap())
    assert refused.value.code == "not_found"


def test_a_map_from_data_is_used_and_not_stored(cell: Cell) -> None:
    used = data_of(cell, UseMapData(map=a_map("given", overlays=WALL)))
    assert (used.id, used.map_name) == (-1, "given")
    assert cell.motion.map == used == data_of(cell, GetMap())
    assert [row.map_name for row in cell.ask_maps(ListMaps()).maps] == ["hall"]


def test_deleting_the_map_in_use_lets_it_go_on_unstored(cell: Cell) -> None:
    before = data_of(cell, GetMap())
    cell.ask_maps(DeleteMap(id=1))
    assert data_of(cell, GetMap()) == before.model_copy(update={"id": -1})
    assert cell.heard(topics.MAP)[-1].map.id == -1


def test_the_choice_survives_a_restart(make_cell: Callable[..., Cell], tmp_path: Path) -> None:
    first = make_cell(path=tmp_path / "s.sqlite")
    used = data_of(first, UseMapData(map=a_map("given", overlays=WALL)))
    first.database.close()
    second = make_cell(path=tmp_path / "s.sqlite")
    assert data_of(second, GetMap()) == used == second.motion.map
    second.ask_maps(SelectMap())
    second.database.close()
    third = make_cell(path=tmp_path / "s.sqlite", with_map=False)
    assert third.maps.current is None


def test_a_uid_is_used_once(cell: Cell) -> None:
    cell.ask_maps(a_map("second", uid="abc"))
    with pytest.raises(RequestRefused, match="uid: 'abc' is already that of map 2"):
        cell.ask_maps(a_map("third", uid="abc"))
    assert len(cell.ask_maps(ListMaps()).maps) == 2


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"png": b""}, "png: not a PNG image (0 bytes, starts with nothing)"),
        ({"png": b"GIF89a" + bytes(50)}, "png: not a PNG image (56 bytes, starts 474946383961"),
        ({"png": png()[:-20]}, "png: truncated or damaged"),
        ({"png": png("RGB")}, "png: its mode is RGB, want 8-bit grey (L)"),
        ({"png": png("1")}, "png: its mode is 1, want 8-bit grey (L)"),
        ({"png": png(size=(12_000, 10_000))}, "png: 12000 × 10000 pixels, want at most 110,000,000"),
        ({"resolution": 5.0}, "resolution: 5.0 m a cell, want 0.001 … 1.0"),
        ({"overlays": {}}, "overlays.type: None, want 'FeatureCollection'"),
        ({"overlays": {"type": "FeatureCollection"}}, "overlays.features: NoneType, want a list"),
        ({"overlays": {"type": "FeatureCollection", "features": [3]}}, "overlays.features[0]: want an object"),
        (
            {"overlays": feature(None)},
            "features[0].geometry: type None, want one of Point, LineString, Polygon",
        ),
        ({"overlays": feature({"type": "Circle"})}, "overlays.features[0].geometry: type 'Circle'"),
        ({"overlays": feature({"type": "Point"})}, "overlays.features[0].geometry.coordinates: NoneType, want a list"),
        ({"overlays": feature({"type": ["Point"]})}, "overlays.features[0].geometry: type ['Point']"),
        (
            {"overlays": feature({"type": "LineString", "coordinates": [[0, 0], [1, "2"]]})},
            "overlays.features[0].geometry.coordinates[1]: [1, '2'], want x, y in metres",
        ),
        ({"overlays": feature({"type": "LineString", "coordinates": [[0, 0]]})}, "1 positions, want at least 2"),
        ({"overlays": feature({"type": "Polygon", "coordinates": []})}, "coordinates: no ring, want at least 1"),
        (
            {"overlays": feature({"type": "Polygon", "coordinates": [[[0, 0], [1, 1], [0, 0]]]})},
            "coordinates[0]: 2 different corners, want at least 3",
        ),
        (
            {"overlays": feature({"type": "Point", "coordinates": [0, 0]}, [])},
            "overlays.features[0].properties: list, want an object",
        ),
        ({"overlays": feature({"type": "Point", "coordinates": [float("nan"), 0]})}, "overlays: not plain JSON"),
        ({"overlays": {"type": "FeatureCollection", "features": [], "x": b"1"}}, "overlays: not plain JSON"),
    ],
)
def test_what_is_no_map_is_refused_with_what_and_where(cell: Cell, fields: dict[str, Any], text: str) -> None:
    bad = a_map("bad").model_copy(update=fields)
    for request in (bad, UseMapData(map=bad)):
        with pytest.raises(RequestRefused) as refused:
            cell.ask_maps(request)
        assert refused.value.code == "invalid"
        assert text in refused.value.text
    if "overlays" in fields:
        with pytest.raises(RequestRefused):
            cell.ask_maps(PatchMap(id=1, overlays=fields["overlays"]))
    assert [row.map_name for row in cell.ask_maps(ListMaps()).maps] == ["hall"]
    assert data_of(cell, GetMap()).map_name == "hall"


def test_good_overlays_pass(cell: Cell) -> None:
    ring = [[0, 0], [1, 0], [1, 1]]
    for geometry in (
        {"type": "Polygon", "coordinates": [ring]},
        {"type": "Polygon", "coordinates": [[*ring, [0, 0]]]},
        {"type": "Point", "coordinates": [0.5, 1, 0]},
    ):
        overlays = feature(geometry, {"type": "34"})
        assert data_of(cell, a_map("x", overlays=overlays)).overlays == overlays


def test_a_map_that_navigation_cannot_read_is_refused_and_the_old_one_stays(cell: Cell) -> None:
    move = cell.create()
    cell.ask_maps(a_map("second"))
    cell.motion.maps = (MoveFailed(MoveFailReason.GET_MAP_FAILED, "all of it is wall"),)
    with pytest.raises(RequestRefused, match="not usable for navigation: all of it is wall"):
        cell.ask_maps(SelectMap(id=2))
    assert cell.motion.map == data_of(cell, GetMap())
    assert data_of(cell, GetMap()).id == 1
    assert cell.get(move.id).state == "moving"


def test_a_stored_map_that_cannot_be_read_at_the_start_fails_moves_with_2(cell: Cell) -> None:
    cell.motion.maps = (MoveFailed(MoveFailReason.GET_MAP_FAILED, "all of it is wall"),)
    cell.chassis.reset("reset")
    move = cell.create()
    cell.tick()
    assert (cell.get(move.id).fail_reason, cell.get(move.id).fail_message) == (2, "all of it is wall")
    assert [alert.code for alert in cell.heard(topics.CHASSIS_STATUS)[-1].alerts] == [1009]


# -- map directories ---------------------------------------------------------------------------------------------------


def test_a_directory_is_imported_once_and_the_choice_kept(make_cell: Callable[..., Cell], tmp_path: Path) -> None:
    world = write_world(tmp_path / "hall", WALL)
    cell = make_cell(with_map=False)
    assert cell.maps.import_directory(read_map_directory(world))
    current = cell.maps.current
    assert current is not None
    assert (current.id, current.map_name, current.overlays, current.origin) == (1, "hall", WALL, (-1.0, -2.0))
    assert current.create_time == int((world / "map.png").stat().st_mtime)
    cell.ask_maps(SelectMap())
    assert not cell.maps.import_directory(read_map_directory(world))
    assert cell.maps.current is None, "what was chosen since persists"
    other = write_world(tmp_path / "other", resolution=0.1)
    assert cell.maps.import_directory(read_map_directory(other))
    assert cell.maps.import_directory(read_map_directory(world)), "another world than at the last start"
    assert [row.map_name for row in cell.maps.list()] == ["hall", "other"], "but it is stored once"
    write_world(world, feature({"type": "Point", "coordinates": [0, 0]}))
    assert cell.maps.import_directory(read_map_directory(world)), "a world that was changed"
    assert len(cell.maps.list()) == 3
