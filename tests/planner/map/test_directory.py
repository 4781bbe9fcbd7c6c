"""Maps from a directory: its content makes the uid, and what is broken is named with its file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rackhand.services.planner.map.directory import MapDirectoryError, read_map_directory
from tests.planner.fakes import png

WAREHOUSE = Path(__file__).parents[3] / "worlds" / "warehouse"


def write_world(directory: Path, overlays: Any = None, **fields: Any) -> Path:
    directory.mkdir(exist_ok=True)
    lines = {"image": "map.png", "resolution": 0.05, "origin": [-1.0, -2.0, 0.0], "negate": 0} | fields
    (directory / "map.yaml").write_text("".join(f"{key}: {json.dumps(value)}\n" for key, value in lines.items()))
    (directory / "map.png").write_bytes(png())
    if overlays is not None:
        (directory / "overlays.geojson").write_text(json.dumps(overlays))
    return directory


def test_the_warehouse() -> None:
    found = read_map_directory(WAREHOUSE)
    assert found.map.map_name and len(found.map.overlays["features"]) == 22
    assert found.map.uid == read_map_directory(WAREHOUSE).map.uid and found.changed > 1_600_000_000


def test_the_uid_changes_with_the_content(tmp_path: Path) -> None:
    one = read_map_directory(write_world(tmp_path / "one", name="hall")).map
    same = read_map_directory(write_world(tmp_path / "same", name="hall")).map
    other = read_map_directory(write_world(tmp_path / "other", name="hall", origin=[-1.0, -3.0, 0.0])).map
    assert one.uid == same.uid != other.uid


@pytest.mark.parametrize(
    ("fields", "text"),
    [
        ({"image": "none.png"}, "none.png: No such file"),
        ({"image": 3}, "want at least the keys image, resolution and origin"),
        ({"resolution": "fine"}, "resolution is 'fine', want a number"),
        ({"resolution": -1}, "resolution"),
        ({"origin": [0]}, r"origin is \[0\], want"),
        ({"origin": [0, 0, 1.5]}, "rotated by 1.5 rad"),
        ({"negate": 2}, "map.yaml: negate is 2, want 0 .* or 1"),
        ({"mode": "Trinary"}, "map.yaml: mode is 'Trinary', want one of trinary, scale, raw"),
        ({"occupied_thresh": "65"}, "occupied_thresh is '65', want a number from 0 to 1"),
        ({"free_thresh": 0.7}, "free_thresh is 0.7, want less than occupied_thresh, which is 0.65"),
        ({"overlays": {"type": "x"}}, "overlays.type: 'x', want 'FeatureCollection'"),
    ],
)
def test_a_bad_directory_says_which_file_and_why(tmp_path: Path, fields: dict[str, Any], text: str) -> None:
    world = write_world(tmp_path / "bad", **fields)
    with pytest.raises(MapDirectoryError, match=text):
        read_map_directory(world)


def test_broken_files_of_a_directory(tmp_path: Path) -> None:
    with pytest.raises(MapDirectoryError, match=r"map\.yaml: No such file"):
        read_map_directory(tmp_path)
    world = write_world(tmp_path / "world", {"type": "FeatureCollection", "features": []})
    (world / "overlays.geojson").write_text("{")
    with pytest.raises(MapDirectoryError, match=r"overlays\.geojson: not JSON"):
        read_map_directory(world)
    (world / "overlays.geojson").write_text("[]")
    with pytest.raises(MapDirectoryError, match="overlays: Input should be a valid dictionary"):
        read_map_directory(world)
    (world / "map.yaml").write_text("a: [")
    with pytest.raises(MapDirectoryError, match=r"map\.yaml: not YAML"):
        read_map_directory(world)
