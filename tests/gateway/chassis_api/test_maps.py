"""Maps over HTTP."""

from __future__ import annotations

import io
import json
import zipfile
from typing import Any

import pytest

from tests.gateway.fake_bus import NOW
from tests.gateway.harness import Gateway, grey_png, map_body

OVERLAYS = {"type": "FeatureCollection", "features": [{"id": "a", "type": "Feature"}]}
ROW_KEYS = [
    "id",
    "uid",
    "map_name",
    "create_time",
    "map_version",
    "overlays_version",
    "thumbnail_url",
    "image_url",
    "url",
    "last_modified_time",
]


def test_a_stored_map_is_listed_with_urls_of_the_host_that_was_asked(gateway: Gateway) -> None:
    created = gateway.http.post("/maps/", json=map_body())
    assert created.status_code == 201
    assert list(created.json()) == ROW_KEYS
    assert gateway.http.get("/maps").json() == [created.json()]
    assert created.json()["image_url"] == f"{gateway.url}/maps/1.png"
    assert gateway.http.get(created.json()["image_url"]).content == grey_png(4, 3)
    assert gateway.http.get(created.json()["thumbnail_url"]).headers["content-type"] == "image/png"


@pytest.mark.parametrize("overlays", [OVERLAYS, json.dumps(OVERLAYS)])
def test_overlays_come_as_object_or_text_and_go_out_as_text(gateway: Gateway, overlays: Any) -> None:
    gateway.http.post("/maps", json=map_body(overlays=overlays))
    detail = gateway.http.get("/maps/1").json()
    assert json.loads(detail["overlays"]) == OVERLAYS
    assert (detail["grid_origin_x"], detail["grid_origin_y"], detail["grid_resolution"]) == (-1.0, -2.0, 0.05)


def test_download_is_a_zip_of_image_and_facts(gateway: Gateway) -> None:
    gateway.http.post("/maps", json=map_body())
    url = gateway.http.get("/maps/1").json()["download_url"]
    archive = zipfile.ZipFile(io.BytesIO(gateway.http.get(url).content))
    assert archive.read("map_1.png") == grey_png(4, 3)
    assert json.loads(archive.read("map_1.yaml"))["map_name"] == "hall"


def test_patch_and_delete(gateway: Gateway) -> None:
    gateway.http.post("/maps", json=map_body())
    assert gateway.http.patch("/maps/1", json={"map_name": "new"}).json()["map_name"] == "new"
    assert gateway.http.patch("/maps/1", json={"overlays": json.dumps(OVERLAYS)}).status_code == 200
    assert gateway.bus.maps[1].overlays == OVERLAYS
    assert (gateway.http.delete("/maps/1").status_code, gateway.bus.maps) == (204, {})
    for _ in range(2):
        gateway.http.post("/maps", json=map_body())
    assert (gateway.http.delete("/maps").status_code, gateway.bus.maps) == (204, {})


def test_choosing_a_stored_map_by_id_or_uid(gateway: Gateway) -> None:
    gateway.http.post("/maps", json=map_body(uid="here"))
    wanted = {
        "id": 1,
        "uid": "here",
        "map_name": "hall",
        "create_time": NOW,
        "map_version": 0,
        "overlays_version": 0,
    }
    for body in ({"map_id": 1}, {"map_uid": "here"}):
        answer = gateway.http.post("/chassis/current-map", json=body)
        assert (answer.status_code, answer.json()) == (200, wanted)
    assert gateway.http.get("/chassis/current-map").json() == wanted


def test_a_map_given_whole_has_id_minus_one(gateway: Gateway) -> None:
    answer = gateway.http.post("/chassis/current-map", json=map_body(overlays=json.dumps(OVERLAYS)))
    assert (answer.status_code, answer.json()["id"]) == (200, -1)
    assert gateway.bus.requests[-1].map.png == grey_png(4, 3)


@pytest.mark.parametrize(
    ("path", "body", "told"),
    [
        ("/maps", map_body(occupancy_grid="%%%"), "occupancy_grid: not base64: "),
        ("/maps", map_body(grid_resolution=0), "grid_resolution: Input should be greater than 0"),
        ("/maps", map_body(overlays="{"), "overlays: not valid JSON: "),
        ("/maps", map_body(overlays="[]"), "overlays: want a GeoJSON object, got list"),
        ("/maps", {}, "map_name: is missing"),
        ("/chassis/current-map", {}, "map_id, map_uid or a whole map must be provided"),
        ("/chassis/current-map", {"map_name": "x", "occupancy_grid": ""}, "grid_origin_x: is missing"),
        ("/chassis/current-map", {"data_url": "file:///etc/passwd"}, "data_url: files on the robot cannot be read"),
        ("/chassis/current-map", {"map_id": "1"}, "map_id: Input should be a valid integer"),
    ],
)
def test_a_wrong_map_is_reported_what_is_wrong(gateway: Gateway, path: str, body: Any, told: str) -> None:
    answer = gateway.http.post(path, json=body)
    assert answer.status_code == 400
    assert answer.json()[0].startswith(told)


def test_put_overwrites_the_whole_map(gateway: Gateway) -> None:
    uid = gateway.http.post("/maps", json=map_body()).json()["uid"]
    whole = map_body(map_name="new", grid_origin_x=5.0, overlays=OVERLAYS, map_version=2)
    answer = gateway.http.put("/maps/1", json=whole)
    assert answer.status_code == 200
    assert list(answer.json()) == ROW_KEYS
    assert (answer.json()["id"], answer.json()["uid"], answer.json()["map_name"]) == (1, uid, "new")
    detail = gateway.http.get("/maps/1").json()
    assert (detail["grid_origin_x"], json.loads(detail["overlays"]), detail["map_version"]) == (5.0, OVERLAYS, 2)
    assert gateway.http.put("/maps/2", json=whole).status_code == 404
    assert gateway.http.put("/maps/1", json={"map_name": "half"}).status_code == 400


def test_versions_are_kept_as_given(gateway: Gateway) -> None:
    row = gateway.http.post("/maps", json=map_body(map_version=3, overlays_version=7)).json()
    assert (row["map_version"], row["overlays_version"]) == (3, 7)
    patched = gateway.http.patch("/maps/1", json={"overlays_version": 40}).json()
    assert (patched["map_version"], patched["overlays_version"]) == (3, 40)
    for wrong in (-1, 1.5, "7", 2**63):
        assert gateway.http.patch("/maps/1", json={"overlays_version": wrong}).status_code == 400


def test_a_map_as_a_form(gateway: Gateway) -> None:
    body = map_body(overlays=json.dumps(OVERLAYS), map_version=3)
    picture = grey_png(5, 6)
    texts = {name: str(value) for name, value in body.items() if name != "occupancy_grid"}
    sent = gateway.http.post("/maps", data=texts, files={"occupancy_grid": ("map.png", picture, "image/png")})
    assert sent.status_code == 201
    assert (sent.json()["map_name"], sent.json()["map_version"]) == ("hall", 3)
    assert gateway.http.get("/maps/1.png").content == picture
    assert gateway.bus.maps[1].origin == (-1.0, -2.0)
    text_only = gateway.http.put("/maps/1", files={name: (None, str(value)) for name, value in body.items()})
    assert text_only.status_code == 200
    assert gateway.http.get("/maps/1.png").content == grey_png(4, 3)
    bad = gateway.http.post("/maps", content=b"--x", headers={"content-type": "multipart/form-data; boundary=x"})
    assert (bad.status_code, bad.json()) == (
        400,
        ["form: the body does not end with the boundary that Content-Type names"],
    )
