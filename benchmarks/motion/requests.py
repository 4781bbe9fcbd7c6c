"""A client of the gateway: sets a long path going, and asks for short motions one by one."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import httpx

from benchmarks.motion.driver import ARM, Driver

START = 120.0  # [s] until the cell answers; the very first start compiles
LEG = 0.3  # [s] of the path's legs, each of which ends with a turn, at least
PATIENCE = 20.0  # [s] of the driver's time for a short motion to begin, and for the arm to come to rest


class Client:
    """POSTs CRF requests. Where a ``driver`` is named, it goes on while a request is under way."""

    def __init__(self, url: str) -> None:
        self._http = httpx.Client(base_url=url, timeout=60.0)
        self._thread = ThreadPoolExecutor(1)

    def ask(self, **request: Any) -> dict[str, Any]:
        answer = self._http.post(f"/motion/{ARM}/command", json={"priority": 10, **request})
        reply: dict[str, Any] = answer.json()
        return reply

    def ask_while_running(self, driver: Driver | None, **request: Any) -> dict[str, Any]:
        if driver is None:
            return self.ask(**request)
        reply = self.begin(**request)
        while not reply.done():
            driver.run_for(0.02)
        return reply.result()

    def begin(self, **request: Any) -> Future[dict[str, Any]]:
        """Send it in a thread of its own."""
        return self._thread.submit(self.ask, **request)

    def wait_until_answered(self, driver: Driver | None = None) -> None:
        """Until the controller is there and has heard the arm."""
        deadline = time.monotonic() + START
        while time.monotonic() < deadline:
            try:
                if driver is not None:
                    driver.run_for(0.1)
                answer = self.ask_while_running(driver, command="getStatus")
                if answer.get("message", {}).get("jointPositions", {}).get("code") == 200:
                    return
            except (httpx.HTTPError, ValueError):
                pass
            time.sleep(0.1)
        raise TimeoutError("the cell does not answer")

    def drive_for(self, seconds: float, driver: Driver | None = None) -> None:
        """Begin a path through waypoints to and fro that takes at least so long."""
        status = self.ask_while_running(driver, command="getStatus")["message"]
        here = status["jointPositions"]["value"]
        there = [here[0] + 1.0, *(q + 0.2 for q in here[1:])]
        beside = [here[0] + 0.5, *(q - 0.2 for q in here[1:])]
        legs = [(there, beside)[i % 2] for i in range(max(4, round(seconds / LEG)))]
        reply = self.ask_while_running(driver, command="appendPath", type="joints", data=legs)
        if reply.get("message", {}).get("code") != 200:
            raise RuntimeError(f"the path is refused: {reply}")

    def check_drives(self, driver: Driver | None = None) -> None:
        """Raises ``RuntimeError`` if the path has ended, with the arm's status."""
        status = self.ask_while_running(driver, command="getStatus")["message"]
        if not status["isTrajectoryRunning"].get("value"):
            raise RuntimeError(f"the path has ended before the measurement; status {status}")


def first_motions(client: Client, driver: Driver, times: int) -> dict[str, list[float]]:
    """Seconds from POST to the first command that differs, by request."""
    found: dict[str, list[float]] = {"setVelocity, joints": [], "appendPath, one waypoint": []}
    for i in range(times):
        sign = 1 if i % 2 else -1
        joints = len(driver.position)
        requests: dict[str, dict[str, Any]] = {
            "setVelocity, joints": {"command": "setVelocity", "type": "joints", "data": [0.2 * sign] * joints},
            "appendPath, one waypoint": {
                "command": "appendPath", "type": "joints", "data": [[q + 0.02 * sign for q in driver.position]],
            },
        }  # fmt: skip
        for name, request in requests.items():
            _come_to_rest(client, driver)
            driver.run_for(0.05 + 0.0007 * i)  # another phase of the period each time
            driver.moved, sent = None, time.perf_counter()
            reply = client.begin(**request)
            found[name].append(_first_motion(driver, client, name, reply) - sent)
    return found


def _first_motion(driver: Driver, client: Client, name: str, reply: Future[dict[str, Any]]) -> float:
    """When [s, perf_counter] the commands first differed, after the answer too."""
    _run_until(driver, lambda: driver.moved is not None and reply.done(), client, f"motion after {name}")
    if driver.moved is None or reply.result()["message"].get("code") != 200:
        raise RuntimeError(f"{name} is refused: {reply.result()}")
    return driver.moved


def _come_to_rest(client: Client, driver: Driver) -> None:
    client.ask_while_running(driver, command="softStop")
    still = 0

    def rests() -> bool:
        nonlocal still
        still = still + 1 if driver.stands else 0
        return still >= 10

    _run_until(driver, rests, client, "standstill after softStop")


def _run_until(driver: Driver, done: Callable[[], bool], client: Client, what: str) -> None:
    """Lets the driver run. Raises ``TimeoutError`` with the arm's status."""
    for _ in range(round(PATIENCE / 0.02)):
        driver.run_for(0.02)
        if done():
            return
    status = client.ask_while_running(driver, command="getStatus").get("message")
    raise TimeoutError(f"{what}: not seen within {PATIENCE:g} s; status {status}")
