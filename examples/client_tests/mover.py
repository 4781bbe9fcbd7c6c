"""A client of the chassis API: sends a robot to a point, and tries again when its sensors fail on the way.

python mover.py http://localhost:8090 5.5 7.5
"""

import json
import sys
import time
import urllib.request
from collections.abc import Callable

SENSOR_FAILURES = {16, 1000}  # control_costmap_error, platform_alert_error: may pass by themselves
ATTEMPTS = 3
PAUSE = 5.0  # s between two attempts


class NotReached(Exception):
    """The robot is not there; the text is the reason that the API gave."""


def request(url: str, body: dict | None = None) -> dict:
    data = None if body is None else json.dumps(body).encode()
    headers = {"Content-Type": "application/json"}
    with urllib.request.urlopen(urllib.request.Request(url, data, headers), timeout=30) as answer:
        return json.load(answer)


def drive(url: str, x: float, y: float, wait: Callable[[float], None] = time.sleep) -> int:
    """Drive to (x, y) in metres of the map. Returns how many attempts it took; raises ``NotReached``."""
    for attempt in range(1, ATTEMPTS + 1):
        move = request(f"{url}/chassis/moves", {"type": "standard", "target_x": x, "target_y": y})
        while move["state"] == "moving":
            time.sleep(0.1)
            move = request(f"{url}/chassis/moves/{move['id']}")
        if move["state"] == "succeeded":
            return attempt
        if move["fail_reason"] not in SENSOR_FAILURES or attempt == ATTEMPTS:
            break
        wait(PAUSE)
    raise NotReached(f"{move['state']}: {move.get('fail_message')}")


if __name__ == "__main__":
    print(f"there after {drive(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]))} attempts")
