"""Maps of scenarios: features as the map's overlays have them, and pictures that are pictures."""

from __future__ import annotations

import io

from PIL import Image

from rackhand.scenarios.maps import blank_png, overlays_of
from rackhand.services.planner.map.overlays import parse_overlays
from rackhand.worlds.scenario_model import MapChange


def test_a_blank_map_is_a_picture_of_free_ground() -> None:
    picture = Image.open(io.BytesIO(blank_png(30, 20)))
    assert (picture.size, picture.mode) == ((30, 20), "L")
    assert picture.getextrema() == (254, 254)


def test_the_planner_reads_what_a_change_adds() -> None:
    corners = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0))
    change = MapChange(
        walls=(corners[:2],),
        no_go=(corners,),
        rack_points={"a": (1.0, 1.0, 90.0)},
        chargers={"c": (0.5, 1.0, 180.0)},
        rack_areas={"area": corners},
    )
    found = parse_overlays({"type": "FeatureCollection", "features": list(overlays_of(change))})
    assert len(found.lines) == 1 and len(found.zones) == 2 and len(found.points) == 2
