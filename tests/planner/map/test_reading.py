"""What the keys ``mode``, ``negate``, ``occupied_thresh`` and ``free_thresh`` of a map's YAML make of its pixels."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from rackhand.schemas.maps import CreateMap, MapData
from rackhand.services.planner.map.directory import read_map_directory
from rackhand.services.planner.map.grid import load_map
from rackhand.services.planner.map.reading import FREE, OCCUPIED, STORED, UNKNOWN, Reading, stored_png

GREYS = np.array([[0, 60, 100, 130, 200, 205, 206, 254, 255]], dtype=np.uint8)


def picture(grey: Any = GREYS) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.asarray(grey, dtype=np.uint8)).save(file, "PNG")
    return file.getvalue()


def letters(description: dict[str, Any], grey: Any = GREYS) -> str:
    """A letter for each pixel: free, unknown, or X for occupied."""
    names = {FREE: "f", UNKNOWN: "u", OCCUPIED: "X"}
    return "".join(names[int(value)] for value in Reading.of(description).cells(np.asarray(grey, np.uint8)).ravel())


@pytest.mark.parametrize(
    ("description", "found"),
    [
        ({}, "XXuuuufff"),
        ({"mode": "trinary", "occupied_thresh": 0.65, "free_thresh": 0.196}, "XXuuuufff"),
        ({"occupied_thresh": 0.45}, "XXXXuufff"),
        ({"occupied_thresh": 0.9}, "Xuuuuufff"),
        ({"free_thresh": 0.25}, "XXuufffff"),
        ({"free_thresh": 0.001}, "XXuuuuuuf"),
        ({"mode": "scale"}, "XXuuuufff"),
        ({"mode": "scale", "occupied_thresh": 0.5}, "XXXuuufff"),
        ({"negate": 1}, "fuuuXXXXX"),
        ({"mode": "raw"}, "fuXuuuuuu"),
        ({"mode": "raw", "negate": 1, "occupied_thresh": 0.1, "free_thresh": 0.05}, "fuXuuuuuu"),
    ],
)
def test_each_key_is_obeyed(description: dict[str, Any], found: str) -> None:
    assert letters(description) == found


@pytest.mark.parametrize("threshold", [0.2, 0.4, 0.8])
def test_a_value_at_a_threshold_is_neither(threshold: float) -> None:
    """Both comparisons are strict, as in map_server."""
    at = round(255 * (1.0 - threshold))
    assert letters({"occupied_thresh": threshold, "free_thresh": 0.0}, [[at - 1, at, at + 1]]) == "Xuu"
    assert letters({"occupied_thresh": 1.0, "free_thresh": threshold}, [[at - 1, at, at + 1]]) == "uuf"


def test_a_picture_that_means_the_same_is_stored_as_it_is() -> None:
    same = picture()
    assert stored_png(same, STORED) is same
    assert stored_png(same, Reading(occupied=0.64)) is same, "no pixel is between 0.64 and 0.65"
    negated = stored_png(same, Reading(negate=True))
    assert negated != same and stored_png(negated, STORED) is negated


def test_the_store_reads_its_pictures_as_the_planner_does() -> None:
    every = np.arange(256, dtype=np.uint8)[None]
    cells = STORED.cells(every)
    for grey in (every, cells):
        made = CreateMap(map_name="m", png=picture(grey), origin=(0.0, 0.0), resolution=0.05)
        row = {"id": 1, "uid": "u", "create_time": 0, "last_modified_time": 0}
        found = load_map(MapData.model_validate({**made.model_dump(exclude={"op", "uid"}), **row}), 0.4)
        assert (found.occupied == (cells == OCCUPIED)).all()
        assert (found.blocked == (cells != FREE)).all()


def test_a_directory_is_read_as_its_yaml_says(tmp_path: Path) -> None:
    lines = {"image": "map.png", "resolution": 0.05, "origin": [0, 0, 0], "mode": "raw"}
    (tmp_path / "map.yaml").write_text("".join(f"{key}: {json.dumps(value)}\n" for key, value in lines.items()))
    (tmp_path / "map.png").write_bytes(picture())
    with Image.open(io.BytesIO(read_map_directory(tmp_path).map.png)) as image:
        assert np.asarray(image).tolist() == [[FREE, UNKNOWN, OCCUPIED] + [UNKNOWN] * 6]
