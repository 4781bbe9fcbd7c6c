"""usage: drive.py URL    Asks for a standard move and an arm path over HTTP, and waits until both have succeeded.
Standard library only.
"""

from __future__ import annotations

import json
import sys
import time
import urllib.request
from typing import Any

GOAL = {"creator": "ci", "type": "standard", "target_x": 5.5, "target_y": 7.5, "target_ori": 0.0}
ARM = "/motion/arm1"
TURN = 0.3  # rad, of every joint
PATIENCE = 180.0

opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))


def ask(url: str, body: object = None) -> tuple[int, dict[str, Any]]:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json"})
    with opener.open(request, timeout=10) as answer:
        return answer.status, json.load(answer)


def main() -> None:
    api, begun = sys.argv[1], time.monotonic()
    status, move = ask(api + "/chassis/moves", GOAL)
    print(f"POST {status}: move {move['id']} {move['state']}")
    if status != 201:
        sys.exit("want 201")
    goal = begin_arm_path(api)
    wait_for_arm(api, goal, begun)
    wait_for_move(f"{api}/chassis/moves/{move['id']}", begun)


def begin_arm_path(api: str) -> list[float]:
    """Where the joints are to end."""
    goal = [q + TURN for q in joints(api)]
    path = {"command": "appendPath", "priority": 10, "type": "joints", "data": [goal]}
    _, answer = ask(f"{api}{ARM}/command", path)
    print(f"appendPath: {answer['message']}")
    if answer["message"].get("value") is not True:
        sys.exit(f"want true, got {answer}")
    return goal


def joints(api: str) -> list[float]:
    _, status = ask(f"{api}{ARM}/status")
    return list(status["jointPositions"]["value"])


def wait_for_arm(api: str, goal: list[float], begun: float) -> None:
    while (off := max(abs(q - wanted) for q, wanted in zip(joints(api), goal, strict=True))) > 1e-3:
        be_patient(begun, f"the arm is still off by {off:.3f} rad")
    print(f"the arm is there after {time.monotonic() - begun:.1f} s")


def wait_for_move(url: str, begun: float) -> None:
    _, move = ask(url)
    while move["state"] in ("idle", "moving"):
        be_patient(begun, f"still {move['state']}")
        _, move = ask(url)
    print(f"{move['state']} after {time.monotonic() - begun:.1f} s: {move['fail_reason_str']} {move['fail_message']}")
    if move["state"] != "succeeded":
        sys.exit(1)


def be_patient(begun: float, what: str) -> None:
    if time.monotonic() - begun > PATIENCE:
        sys.exit(f"{what} after {PATIENCE:g} s")
    time.sleep(0.5)


if __name__ == "__main__":
    main()
