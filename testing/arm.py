"""A small client of an arm: CRF requests over HTTP, and the tool driven to points of the map."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import TracebackType
from typing import Any

import httpx
import numpy as np

from rackhand.bus import Bus, Sample
from rackhand.schemas import topics
from rackhand.schemas.motion import ArmModel
from rackhand.schemas.service import CELL, ServiceId
from rackhand.testing.cell import Cell
from rackhand.testing.poses import heading

Json = dict[str, Any]
HTTP_TIMEOUT = 60.0  # s of wall time; only ever bounds a failure
CUP = 0.12  # m, from the flange to the rim of the suction cup, along the flange's z axis
# As the tool points at home: the flange's z down, its x along the base's y.
DOWN: Json = {"Matrix": {"Row1": [0, 1, 0], "Row2": [1, 0, 0], "Row3": [0, 0, -1]}}


class Arm:
    """One client of one arm. ``name``: of the arm; ``client``: what the controller knows this client by."""

    def __init__(self, cell: Cell, name: str = "arm1", client: str = "test", priority: int = 10) -> None:
        self.cell, self.name, self.priority = cell, name, priority
        self._model_read: ArmModel | None = None
        self._http = httpx.Client(
            base_url=cell.http, timeout=HTTP_TIMEOUT, trust_env=False, headers={"X-Client": client}
        )

    def __enter__(self) -> Arm:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        self._http.close()

    def ask(self, command: str, **fields: Any) -> Json:
        """The answer to one request, whatever it is."""
        answer = self._http.post(f"/motion/{self.name}/command", json={"command": command, **fields})
        assert answer.status_code == 200, f"{command} -> {answer.status_code} {answer.text[:300]}"
        return dict(answer.json())

    def ok(self, command: str, **fields: Any) -> None:
        """One request at this client's priority; asserts that it is carried out."""
        answer = self.ask(command, **{"priority": self.priority, **fields})
        message = answer["message"]
        assert message is True or (isinstance(message, dict) and message.get("value") is True), answer

    def status(self) -> Json:
        """What ``getStatus`` answers: measured signals, who holds control, the gripper."""
        return dict(self.ask("getStatus")["message"])

    def joints(self) -> list[float]:
        """Measured joint positions, in radians."""
        return list(self.status()["jointPositions"]["value"])

    def wait_until_ready(self) -> None:
        """Until the controller has joined the world and has seen the arm."""
        controller = f"{self.name}/controller"
        self.cell.wait_for(lambda: controller in self.cell.inspect().participants or None, f"{controller} has joined")
        if self.cell.inspect().clock.paused:
            self.cell.advance(0.1)
        self.cell.wait_for(lambda: self.status()["status"] == "initialize" or None, f"{controller} has seen the arm")

    def finish(self, within: float = 30.0) -> None:
        """Until the path is driven; ``within`` in seconds of simulation time."""

        def rests() -> bool | None:
            return None if self.status()["isTrajectoryRunning"]["value"] else True

        self.cell.until(rests, f"{self.name} has driven its path", within, step=0.5)

    def go(self, *points: Sequence[float]) -> None:
        """The rim of the cup, pointing down, in a straight line from point to point of the map (x, y, z in m)."""
        poses = [{"Position": self.in_base(x, y, z + CUP), "Orientation": DOWN} for x, y, z in points]
        self.ok("appendPath", type="task", data=poses, method=2, reference=1)
        self.finish()

    def suction(self, on: bool) -> bool:
        """Switch the gripper; whether it holds something 0.1 s later, where the world is paused."""
        self.ok("setGripper", suction=on)
        if self.cell.inspect().clock.paused:
            self.cell.advance(0.1)
        return bool(self.status()["gripper"]["holding"])

    def in_base(self, x: float, y: float, z: float) -> list[float]:
        """A point of the map in the frame of the arm's base (m)."""
        model = self._model()
        yaw = heading(model.orientation)
        dx, dy, dz = np.subtract((x, y, z), model.position).tolist()
        cos, sin = math.cos(yaw), math.sin(yaw)
        return [dx * cos + dy * sin, dy * cos - dx * sin, dz]

    def _model(self) -> ArmModel:
        if self._model_read is None:
            with Bus(ServiceId("test_arm", CELL), self.cell.bus_config()) as bus:
                event = bus.inbox().subscribe(topics.ARM_MODEL, self.name).get(timeout=20)
                assert isinstance(event, Sample), f"{self.name} publishes no model"
                self._model_read = event.message
        return self._model_read
