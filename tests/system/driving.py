"""A client of the Move API as tests need one: post, follow, select maps."""

from __future__ import annotations

import base64
import copy
import json
from collections.abc import Callable
from typing import Any

import httpx

from rackhand.schemas.moves import TERMINAL
from rackhand.schemas.world import WorldReply
from tests.system.cell import Cell
from tests.system.judge import Judge

Json = dict[str, Any]


class Driver:
    """Posts moves over HTTP and follows them; time is the judge's simulation time, so load changes nothing."""

    def __init__(self, cell: Cell, judge: Judge) -> None:
        self.cell = cell
        self.judge = judge
        self._http = httpx.Client(base_url=cell.http, timeout=30.0)

    def close(self) -> None:
        self._http.close()

    def request(self, method: str, path: str, body: Any = None, status: int | None = None) -> Any:
        """The answer's JSON; asserts the status when one is named, else only that it is a success."""
        answer = self._http.request(method, path, json=body)
        told = f"{method} {path} -> {answer.status_code} {answer.text[:300]}"
        assert answer.status_code == status if status else answer.is_success, told
        return answer.json() if answer.content else None

    def post(self, body: Json) -> int:
        return int(self.request("POST", "/chassis/moves", body, 201)["id"])

    def move(self, move_id: int) -> Json:
        return dict(self.request("GET", f"/chassis/moves/{move_id}"))

    def finish(self, move_id: int, within: float = 240.0) -> Json:
        """Wait until that move has ended; within so many seconds of simulation time."""
        begun = self.judge.now()
        return self.cell.wait_for(lambda: self._ended(move_id, begun, within), f"move {move_id} ends", 600.0)

    def drive(self, body: Json, within: float = 240.0) -> Json:
        return self.finish(self.post(body), within)

    def wait(self, holds: Callable[[WorldReply], bool], what: str) -> WorldReply:
        """Poll the world until something holds in it."""

        def found() -> WorldReply | None:
            world = self.judge.inspect()
            return world if holds(world) else None

        return self.cell.wait_for(found, what, 120.0)

    def wait_until_joined(self) -> None:
        """And until the planner has answered: what is asked of it then does not change its first answer."""
        self.wait(
            lambda world: "amr1/planner" in world.participants and "amr1" in world.command_stamps,
            "the planner has joined",
        )

    def wait_until_moving(self, start_x: float, start_y: float, by: float = 0.5) -> None:
        """Wait until the chassis has truly left that place."""

        def left() -> bool | None:
            pose = self.judge.true_pose("amr1")
            return True if (pose.x - start_x) ** 2 + (pose.y - start_y) ** 2 > by**2 else None

        self.cell.wait_for(left, "the chassis moves", 120.0)

    # -- maps --------------------------------------------------------------------------------------------------------

    def overlay(self, *features: Json) -> None:
        """Use the geometry of the map the cell came with, with these overlay features only."""
        stored = self._base_map()
        png = self._http.get(f"/maps/{stored['id']}.png").content
        self.use_map(png, stored["grid_origin_x"], stored["grid_origin_y"], stored["grid_resolution"], *features)

    def use_map(self, png: bytes, origin_x: float, origin_y: float, resolution: float, *features: Json) -> None:
        """Use a map given whole."""
        body = {
            "map_name": "of a test",
            "occupancy_grid": base64.b64encode(png).decode(),
            "carto_map": "",
            "grid_resolution": resolution,
            "grid_origin_x": origin_x,
            "grid_origin_y": origin_y,
            "overlays": json.dumps({"type": "FeatureCollection", "features": copy.deepcopy(features)}),
        }
        self.request("POST", "/chassis/current-map", body)

    def use_stored_map(self) -> None:
        """Back to the map the cell came with."""
        self.request("POST", "/chassis/current-map", {"map_id": self._base_map()["id"]})

    def _base_map(self) -> Json:
        stored = min(self.request("GET", "/maps/"), key=lambda row: row["id"])
        return dict(self.request("GET", f"/maps/{stored['id']}"))

    def _ended(self, move_id: int, begun: float, within: float) -> Json | None:
        move = self.move(move_id)
        if move["state"] in TERMINAL:
            return move
        elapsed = self.judge.now() - begun
        assert elapsed < within, f"move {move_id} still {move['state']} after {elapsed:.0f} s: {move}"
        return None


def wall(*points: tuple[float, float]) -> Json:
    """A virtual wall along these points."""
    geometry = {"type": "LineString", "coordinates": [list(point) for point in points]}
    return {"type": "Feature", "id": "wall", "geometry": geometry, "properties": {"lineType": 2}}


def no_go(*points: tuple[float, float]) -> Json:
    """A region nobody may pass."""
    ring = [list(point) for point in (*points, points[0])]
    properties = {"regionType": 1, "blocked": False}
    return {
        "type": "Feature",
        "id": "zone",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": properties,
    }


def square(x: float, y: float, half: float) -> tuple[tuple[float, float], ...]:
    return ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))
