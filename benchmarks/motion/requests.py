"""A client of the gateway: sets a long path going, and asks for short motions one by one."""

from __future__ import annotations

import time
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import httpx

from benchmarks.motion.driver import ARM, Driver
from rackhand.services.controller.ik import load_arm

START = 120.0  # [s] until the cell answers; the very first start compiles


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
        speeds = load_arm("ur5e" if len(here) == 6 else "fr3").limits.velocity
        slowest = 0.5 * 0.5 / float(speeds.min())  # [s] of a leg, at least
        legs = [(there, beside)[i % 2] for i in range(max(4, round(seconds / slowest)))]
        reply = self.ask_while_running(driver, command="appendPath", type="joints", data=legs)
        if reply.get("message", {}).get("code") != 200:
            raise RuntimeError(f"the path is refused: {reply}")


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
            while driver.moved is None or not reply.done():
                driver.run_for(0.02)
            found[name].append(driver.moved - sent)
    return found


def _come_to_rest(client: Client, driver: Driver) -> None:
    client.ask_while_running(driver, command="softStop")
    still = 0
    while still < 5:
        driver.run_for(0.05)
        still = still + 1 if driver.stands else 0
