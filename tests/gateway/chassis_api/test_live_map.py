"""``/ros/map``: overlays and closed zones of the map in use, changed live; files of a map given back as they were."""

from __future__ import annotations

import base64
from typing import Any

import pytest

from tests.gateway.harness import Gateway, map_body

POINT = {
    "type": "Feature", "id": "p", "geometry": {"type": "Point", "coordinates": [1.0, 2.0]}, "properties": {"type": 25}
}  # fmt: skip
ZONE = {"id": "aisle", "polygon": [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]]}


def overlays(*features: Any) -> dict[str, Any]:
    return {"type": "FeatureCollection", "features": list(features)}


@pytest.fixture
def uid(gateway: Gateway) -> str:
    """Of a map in use."""
    made = gateway.http.post("/maps", json=map_body()).json()
    assert gateway.http.post("/chassis/current-map", json={"map_id": made["id"]}).status_code == 200
    return str(made["uid"])


def test_overlays_are_changed_while_the_map_is_in_use(gateway: Gateway, uid: str) -> None:
    answer = gateway.http.put("/ros/map/overlays", json=overlays(POINT))
    assert (answer.status_code, answer.json()["success"]) == (200, True)
    assert gateway.http.get("/ros/map/overlays").json() == overlays(POINT)


def test_closed_zones_are_no_go_zones_of_their_own(gateway: Gateway, uid: str) -> None:
    http = gateway.http
    http.put("/ros/map/overlays", json=overlays(POINT))
    assert http.put("/ros/map/traffic_info", json={"map_uid": uid, "no_passing_zones": [ZONE]}).status_code == 200
    found = http.get("/ros/map/traffic_info").json()
    assert (found["map_uid"], [zone["id"] for zone in found["no_passing_zones"]]) == (uid, ["aisle"])
    in_use = gateway.bus.current_map
    assert in_use is not None
    assert [one["properties"].get("regionType") for one in in_use.overlays["features"]] == [None, 1]
    assert http.get("/ros/map/overlays").json() == overlays(POINT), "and are not among the overlays"
    http.put("/ros/map/overlays", json=overlays())
    assert len(http.get("/ros/map/traffic_info").json()["no_passing_zones"]) == 1, "nor opened by them"
    http.put("/ros/map/traffic_info", json={"no_passing_zones": []})
    assert http.get("/ros/map/traffic_info").json()["no_passing_zones"] == []


@pytest.mark.parametrize(
    ("path", "body"),
    [
        ("overlays", []),
        ("overlays", {"type": "FeatureCollection"}),
        ("traffic_info", {"map_uid": "another"}),
        ("traffic_info", {"no_passing_zones": [{"id": "a", "polygon": [[0, 0]]}]}),
        ("traffic_info", {"no_passing_zones": [ZONE | {"time_rules": ["Mo-Fr"]}]}),
    ],
)
def test_what_is_malformed_is_refused(gateway: Gateway, uid: str, path: str, body: Any) -> None:
    assert gateway.http.put(f"/ros/map/{path}", json=body).status_code == 400


@pytest.mark.parametrize("path", ["overlays", "traffic_info"])
def test_without_a_map_there_are_none(gateway: Gateway, path: str) -> None:
    assert gateway.http.get(f"/ros/map/{path}").status_code == 404
    assert gateway.http.put(f"/ros/map/{path}", json=overlays()).status_code == 404


def test_the_file_of_a_map_comes_back_as_it_was(gateway: Gateway) -> None:
    data = bytes(range(256))
    made = gateway.http.post("/maps", json=map_body(carto_map=base64.b64encode(data).decode())).json()
    detail = gateway.http.get(f"/maps/{made['id']}").json()
    assert gateway.http.get(detail["pbstream_url"]).content == data
    bare = gateway.http.post("/maps", json=map_body()).json()["id"]
    assert gateway.http.get(f"/maps/{bare}").json()["pbstream_url"] is None
    assert gateway.http.get(f"/maps/{bare}.pbstream").status_code == 404
    assert gateway.http.post("/maps", json=map_body(carto_map="%")).status_code == 400


def test_all_moves_that_have_ended_are_forgotten(gateway: Gateway) -> None:
    for x in (1.0, 2.0):
        gateway.http.post("/chassis/moves", json={"target_x": x, "target_y": 0.0})
    assert gateway.http.delete("/chassis/moves").status_code == 204
    assert [(move["id"], move["state"]) for move in gateway.http.get("/chassis/moves").json()] == [(2, "moving")]
