"""A whole rack job: under the rack at s8, up, to s7, down, out.

python examples/04_rack_job.py http://localhost:8090
"""

import json
import sys
import time
import urllib.request

URL = sys.argv[1]
FROM, TO, ASIDE = (7.8, 9.4), (5.8, 9.4), (5.5, 7.5)  # rack points s8 and s7, and a free place


def call(path: str, body: dict | None = None) -> dict:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(URL + path, data, {"Content-Type": "application/json"})
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.load(answer)


def drive(kind: str, target: tuple[float, float]) -> None:
    move = call("/chassis/moves", {"type": kind, "target_x": target[0], "target_y": target[1]})
    while move["state"] == "moving":
        time.sleep(0.2)
        move = call(f"/chassis/moves/{move['id']}")
    if move["state"] != "succeeded":
        sys.exit(f"{kind}: {move['state']}, reason {move['fail_reason']}: {move['fail_message']}")
    print(f"{kind}: succeeded")


def jack(direction: str, load: str) -> None:
    call(f"/services/jack_{direction}", {})
    while call("/chassis/jack")["load"] != load:
        time.sleep(0.2)
    print(f"jack {direction}: {load}")


drive("align_with_rack", FROM)
jack("up", "carrying")
drive("to_unload_point", TO)
jack("down", "under_rack")
drive("standard", ASIDE)  # first drives out from under the rack
