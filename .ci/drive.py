"""usage: drive.py URL    Asks for one standard move over HTTP and waits until it succeeded. Standard library only."""

from __future__ import annotations

import json
import sys
import time
import urllib.request

GOAL = {"creator": "ci", "type": "standard", "target_x": 5.5, "target_y": 7.5, "target_ori": 0.0}
PATIENCE = 180.0

opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))


def ask(url: str, body: object = None) -> tuple[int, dict[str, object]]:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json"})
    with opener.open(request, timeout=10) as answer:
        return answer.status, json.load(answer)


def main() -> None:
    moves = sys.argv[1] + "/chassis/moves"
    begun = time.monotonic()
    status, move = ask(moves, GOAL)
    print(f"POST {status}: move {move['id']} {move['state']}")
    if status != 201:
        sys.exit("want 201")
    while move["state"] in ("idle", "moving"):
        if time.monotonic() - begun > PATIENCE:
            sys.exit(f"still {move['state']} after {PATIENCE:g} s")
        time.sleep(0.5)
        _, move = ask(f"{moves}/{move['id']}")
    print(f"{move['state']} after {time.monotonic() - begun:.1f} s: {move['fail_reason_str']} {move['fail_message']}")
    if move["state"] != "succeeded":
        sys.exit(1)


if __name__ == "__main__":
    main()
