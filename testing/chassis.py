"""A small client of the chassis API: post moves, wait for them, select maps."""

from __future__ import annotations

import base64
import copy
import json
from types import TracebackType
from typing import Any

import httpx

from rackhand.schemas.moves import TERMINAL
from rackhand.testing.cell import Cell

Json = dict[str, Any]
HTTP_TIMEOUT = 30.0  # s of wall time; only ever bounds a failure


class Chassis:
    """Orders to the first chassis of a cell. Waiting is in simulation time, so that load changes nothing."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self._http = httpx.Client(base_url=cell.http, timeout=HTTP_TIMEOUT, trust_env=False)

    def __enter__(self) -> Chassis:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._http.close()

    def request(self, method: str, path: str, body: Any = None, status: int | None = None) -> Any:
        """The answer's JSON; asserts the status when one is named, else that it is a success."""
        answer = self._http.request(method, path, json=body)
        text = f"{method} {path} -> {answer.status_code} {answer.text[:300]}"
        assert answer.status_code == status if status else answer.is_success, text
        return answer.json() if answer.content else None

    # -- moves -------------------------------------------------------------------------------------------------------

    def post(self, move: str | Json, /, **fields: Any) -> int:
        """Start a move, as ``post("standard", target_x=5.5, target_y=7.5)``; returns its id."""
        body = {"creator": "test", "type": move} if isinstance(move, str) else move
        return int(self.request("POST", "/chassis/moves", {**body, **fields}, 201)["id"])

    def move(self, move_id: int) -> Json:
        """A move's record, with ``state``, ``fail_reason`` and ``fail_message``."""
        return dict(self.request("GET", f"/chassis/moves/{move_id}"))

    def finish(self, move_id: int, within: float = 240.0) -> Json:
        """The record of a move when it has ended; ``within`` in seconds of simulation time."""

        def ended() -> Json | None:
            move = self.move(move_id)
            return move if move["state"] in TERMINAL else None

        return self.cell.until(ended, f"move {move_id} has ended", within)

    def drive(self, move: str | Json, /, within: float = 240.0, **fields: Any) -> Json:
        """``post`` and ``finish``."""
        return self.finish(self.post(move, **fields), within)

    def cancel(self) -> None:
        """End the running move, if there is one."""
        answer = self._http.patch("/chassis/moves/current", json={"state": "cancelled"})
        assert answer.is_success or answer.status_code == 404, answer.text

    # -- maps --------------------------------------------------------------------------------------------------------

    def overlay(self, *features: Json) -> None:
        """Use the geometry of the map the cell came with, with these overlay features (GeoJSON) only."""
        stored = self.base_map()
        png = self._http.get(f"/maps/{stored['id']}.png").content
        self.use_map(png, stored["grid_origin_x"], stored["grid_origin_y"], stored["grid_resolution"], *features)

    def use_map(self, png: bytes, origin_x: float, origin_y: float, resolution: float, *features: Json) -> None:
        """Use a map that the test brings: an occupancy grid as PNG, its origin (m) and its resolution (m a pixel)."""
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
        self.request("POST", "/chassis/current-map", {"map_id": self.base_map()["id"]})

    def base_map(self) -> Json:
        """The stored map the cell came with."""
        stored = min(self.request("GET", "/maps/"), key=lambda row: row["id"])
        return dict(self.request("GET", f"/maps/{stored['id']}"))
