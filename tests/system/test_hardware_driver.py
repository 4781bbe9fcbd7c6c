"""The example driver in place of the simulator: a real planner and gateway drive it, and its death is noticed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from rackhand.bus import Bus, Sample
from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.service import CELL, ServiceId
from rackhand.services.launch.background import START, environment
from rackhand.testing import Cell
from tests.system.cell import ROOT

EXAMPLE = ROOT / "examples" / "09_hardware_driver.py"
Json = dict[str, Any]


class Robot:
    """A cell without a simulator, and the process of the driver in its place."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self._http = httpx.Client(base_url=cell.http, timeout=30.0)
        self._bus = Bus(ServiceId("witness", CELL), cell.bus_config())
        self._bus.__enter__()
        self._odometry = self._bus.inbox().subscribe(topics.ODOMETRY, "amr1", depth=1)
        self._process: subprocess.Popen[bytes] | None = None

    def start_driver(self) -> None:
        with self.cell.log.open("ab") as log:
            self._process = subprocess.Popen(
                [sys.executable, str(EXAMPLE), "--robot", "amr1"],
                env=environment() | {"RACKHAND_BUS_CONNECT": self.cell.bus},
                stdout=log,
                stderr=subprocess.STDOUT,
            )

    def signal(self, number: signal.Signals) -> None:
        assert self._process is not None
        os.kill(self._process.pid, number)
        if number == signal.SIGKILL:
            self._process.wait()

    def close(self) -> None:
        self._http.close()
        self._bus.__exit__(None, None, None)
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def post(self, x: float, y: float) -> httpx.Response:
        move = {"creator": "test", "type": "standard", "target_x": x, "target_y": y, "target_ori": 0.0}
        return self._http.post("/chassis/moves", json=move)

    def begin(self, x: float, y: float) -> int:
        answer = self.post(x, y)
        assert answer.status_code == 201, answer.text
        return int(answer.json()["id"])

    def ended(self, move_id: int) -> Json | None:
        move = dict(self._http.get(f"/chassis/moves/{move_id}").json())
        return move if move["state"] != "moving" else None

    def finish(self, move_id: int) -> Json:
        return self.cell.wait_for(lambda: self.ended(move_id), f"move {move_id} ends", 120.0)

    def pose(self) -> Pose2:
        event = self._odometry.get(timeout=20)
        assert isinstance(event, Sample)
        pose: Pose2 = event.message.pose
        return pose

    def wait_until_driving(self) -> None:
        start = self.pose()
        while abs(self.pose().x - start.x) < 0.3:
            pass

    def seconds_until_failed(self, move_id: int, since: float) -> tuple[float, Json]:
        move = self.finish(move_id)
        return time.monotonic() - since, move


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Robot]:
    cell = Cell(
        tmp_path_factory.mktemp("cell"), "--no-sim", "--robot", "amr1", world="empty", lockstep=False, crf=False
    )
    cell.start()
    try:
        robot = Robot(cell)
        robot.start_driver()
        try:
            cell.wait_until_up(START)
            yield robot
        finally:
            robot.close()
    finally:
        cell.stop()


def test_a_move_over_http_moves_it_to_the_target(robot: Robot) -> None:
    assert robot.finish(robot.begin(2.0, 1.0))["state"] == "succeeded"
    pose = robot.pose()
    assert (pose.x, pose.y, pose.yaw) == pytest.approx((2.0, 1.0, 0.0), abs=0.06)


def test_a_driver_that_is_killed_fails_the_move_within_2_s_and_both_recover(robot: Robot) -> None:
    move = robot.begin(-6.0, 0.0)
    robot.wait_until_driving()
    robot.signal(signal.SIGKILL)
    took, ended = robot.seconds_until_failed(move, time.monotonic())
    assert (ended["state"], ended["fail_reason"]) == ("failed", 1000)
    assert "the chassis driver disconnected during the move" in ended["fail_message"]
    assert took < 2.0
    refused = robot.post(1.0, 0.0)
    assert refused.status_code == 503
    assert "the chassis driver disconnected" in refused.text
    robot.start_driver()
    robot.cell.wait_until_up()
    assert robot.finish(robot.begin(1.0, 0.5))["state"] == "succeeded"


def test_a_driver_that_hangs_fails_the_move_within_2_s_and_goes_on_later(robot: Robot) -> None:
    move = robot.begin(-3.0, 0.5)
    robot.wait_until_driving()
    robot.signal(signal.SIGSTOP)
    took, ended = robot.seconds_until_failed(move, time.monotonic())
    assert (ended["state"], ended["fail_reason"]) == ("failed", 1000)
    assert took < 2.0
    assert robot.post(1.0, 0.0).status_code == 503
    robot.signal(signal.SIGCONT)
    robot.cell.wait_for(lambda: robot.post(1.0, 0.0).status_code == 201 or None, "a move is accepted again")
    assert robot.finish(robot.begin(0.0, 0.5))["state"] == "succeeded"


def test_the_example_is_short_and_needs_no_simulator() -> None:
    text = EXAMPLE.read_text()
    assert len(text.splitlines()) < 150
    unwanted = "{'mujoco', 'rackhand.services'}"
    probe = f"import runpy, sys; runpy.run_path(sys.argv[1]); assert not {unwanted} & set(sys.modules)"
    subprocess.run([sys.executable, "-c", probe, str(EXAMPLE)], check=True, cwd=Path("/"))
