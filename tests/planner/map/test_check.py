from __future__ import annotations

from typing import Any

import pytest

from rackhand.schemas.maps import CreateMap
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.map.check import MAX_PIXELS, check_map, check_overlays, check_png
from tests.planner.fakes import a_map, png


def refused(created: CreateMap) -> str:
    with pytest.raises(RequestRefused) as error:
        check_map(created)
    assert error.value.code is RefusalCode.INVALID
    return error.value.text


def test_a_good_map_passes_and_a_png_has_its_size() -> None:
    check_map(a_map("good"))
    assert check_png(png(size=(30, 20))) == (30, 20)


@pytest.mark.parametrize("cut", [0, 7, 30, -20])
def test_a_png_that_does_not_end(cut: int) -> None:
    assert refused(a_map("bad").model_copy(update={"png": png()[:cut]})).startswith("png: ")


@pytest.mark.parametrize("resolution", [0.0009, 1.1])
def test_resolution_has_its_range(resolution: float) -> None:
    text = refused(a_map("bad").model_copy(update={"resolution": resolution}))
    assert text == f"resolution: {resolution} m a cell, want 0.001 … 1.0"


def test_pixels_are_limited_before_they_are_decoded() -> None:
    text = refused(a_map("bad").model_copy(update={"png": png(size=(MAX_PIXELS, 2))}))
    assert "want at most 110,000,000 in all" in text


@pytest.mark.parametrize(
    ("overlays", "text"),
    [
        ({"type": "FeatureCollection", "features": [], "x": b"1"}, "overlays: not plain JSON"),
        ({"type": "FeatureCollection", "features": {}}, "overlays.features: dict, want a list"),
    ],
)
def test_overlays_are_plain_json_and_features(overlays: dict[str, Any], text: str) -> None:
    with pytest.raises(RequestRefused) as error:
        check_overlays(overlays)
    assert error.value.text.startswith(text)
