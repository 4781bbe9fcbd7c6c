"""Mapping runs: a room that is seen from inside is drawn where it is."""

from __future__ import annotations

import io
import math

import numpy as np
import pytest
from PIL import Image

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import LocalisedPose, Scan
from rackhand.services.gateway.mapping import Mapping
from tests.gateway import messages
from tests.gateway.harness import Gateway

ROOM = 4.0  # m from wall to wall, about the map's origin


def room_scan(pose: Pose2, stamp: int = 0) -> Scan:
    """What is seen of four walls from a pose inside."""
    angles = pose.yaw - math.pi + np.arange(720) * math.tau / 720
    c, s = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        walls = [(ROOM / 2 - pose.x) / c, (-ROOM / 2 - pose.x) / c, (ROOM / 2 - pose.y) / s, (-ROOM / 2 - pose.y) / s]
    ranges = np.min([np.where(wall > 0, wall, np.inf) for wall in walls], axis=0).astype("<f4")
    lidar = Pose2(x=0.0, y=0.0, yaw=0.0)
    return Scan(stamp=stamp, sensor=lidar, angle_min=-math.pi, angle_step=math.tau / 720, range_max=25.0, ranges=ranges)


def drawn(run: Mapping) -> tuple[np.ndarray, float, float]:
    """Grey values with row 0 at the bottom, and the lower-left corner."""
    return np.asarray(Image.open(io.BytesIO(run.png())))[::-1], *run.origin


def shade(run: Mapping, x: float, y: float) -> int:
    grey, x0, y0 = drawn(run)
    return int(grey[int((y - y0) / 0.05), int((x - x0) / 0.05)])


def test_walls_are_occupied_the_room_is_free_and_beyond_is_unknown() -> None:
    run = Mapping(1, 0, Pose2(x=0.0, y=0.0, yaw=0.0))
    for k in range(4):
        pose = Pose2(x=0.2 * k - 0.3, y=0.1, yaw=0.4 * k)
        run.take(room_scan(pose, k * 1_000_000_000), pose)
    grey, x0, y0 = drawn(run)
    rows, columns = np.nonzero(grey == 0)
    off = np.abs(np.maximum(np.abs(x0 + 0.05 * columns + 0.025), np.abs(y0 + 0.05 * rows + 0.025)) - ROOM / 2)
    assert len(rows) > 4 * 0.8 * ROOM / 0.05, "most of the four walls"
    assert off.max() <= 0.051
    assert (shade(run, 0.0, 0.0), shade(run, 1.5, 1.5), shade(run, 2.3, 0.0)) == (254, 254, 205)


def test_the_new_frame_begins_at_the_start() -> None:
    start = Pose2(x=0.5, y=-0.5, yaw=math.pi / 2)
    run = Mapping(1, 0, start)
    run.take(room_scan(start), start)
    assert run.trajectory == [(0.0, 0.0)]
    assert shade(run, 2.51, 0.0) == 0, "the wall at y = 2 is 2.5 m ahead"


def test_beams_without_a_return_free_what_they_pass_and_those_without_a_measurement_nothing() -> None:
    here = Pose2(x=0.0, y=0.0, yaw=0.0)
    scan = room_scan(here)
    for value, wanted in ((np.inf, 254), (np.nan, 205)):
        run = Mapping(1, 0, here)
        run.take(scan.model_copy(update={"ranges": np.full(720, value, dtype="<f4")}), here)
        shades = shade(run, 3.0, 0.0) if run.grid.odds.size else 205
        assert shades == wanted


def test_a_run_over_http_from_scans_becomes_a_map(gateway: Gateway) -> None:
    http = gateway.http
    assert http.post("/mappings", json={}).status_code == 503, "no pose yet"
    here = Pose2(x=0.0, y=0.0, yaw=0.0)
    pose = LocalisedPose(stamp=messages.SECOND, pose=here, covariance=np.eye(3) * 1e-4, quality=10)
    gateway.publish(topics.POSE, pose)
    run = http.post("/mappings/", json={"continue_mapping": False, "start_pose_type": "zero"})
    assert (run.status_code, run.json()["state"], run.json()["image_url"]) == (201, "running", None)
    assert http.post("/mappings", json={}).status_code == 400, "one at a time"
    gateway.publish(topics.SCAN, room_scan(here, messages.SECOND))
    gateway.publish(topics.POSE, pose.model_copy(update={"stamp": messages.SECOND + 1}))
    assert http.post("/maps", json={"map_name": "x", "mapping_id": 1}).status_code == 400, "not finished"
    done = http.patch("/mappings/current", json={"state": "finished"}).json()
    assert (done["state"], done["grid_resolution"]) == ("finished", 0.05) and done["grid_origin_x"] < -1.9
    assert http.get("/mappings").json() == [done]
    assert http.get("/mappings/1/trajectories.json").json() == [{"id": 0, "coordinates": [[0.0, 0.0]]}]
    made = http.post("/maps", json={"map_name": "drawn", "mapping_id": 1})
    assert made.status_code == 201
    detail = http.get(f"/maps/{made.json()['id']}").json()
    assert (detail["map_name"], detail["grid_origin_x"]) == ("drawn", done["grid_origin_x"])
    picture = np.asarray(Image.open(io.BytesIO(http.get(done["image_url"]).content)))
    assert {0, 205, 254} == set(np.unique(picture))
    assert http.delete("/mappings/1").status_code == 204
    assert http.get("/mappings/1").status_code == 404


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("POST", "/mappings", {"continue_mapping": True}, 400),
        ("POST", "/mappings", {"start_pose_type": "x"}, 400),
        ("PATCH", "/mappings/current", {"state": "finished"}, 404),
        ("GET", "/mappings/7", None, 404),
        ("POST", "/maps", {"map_name": "x", "mapping_id": 7}, 400),
    ],
)
def test_what_cannot_be_is_refused(
    gateway: Gateway, method: str, path: str, body: dict[str, object] | None, status: int
) -> None:
    assert gateway.http.request(method, path, json=body).status_code == status
