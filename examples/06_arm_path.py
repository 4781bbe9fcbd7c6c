"""An arm moves under a held lock, and lets go of it: CRF requests over HTTP.

python examples/06_arm_path.py http://localhost:8090
"""

import json
import sys
import time
import urllib.request

URL = sys.argv[1]
HOME = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0]  # rad


def ask(command: str, **fields: object) -> object:
    body = json.dumps({"command": command, "client": "example", **fields}).encode()
    request = urllib.request.Request(f"{URL}/motion/arm1/command", body, {"Content-Type": "application/json"})
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.load(answer)["message"]


if ask("lockControl", priority=10) is not True:
    sys.exit("another client holds the arm")
path = [[0.4, *HOME[1:]], HOME]
planned = ask("appendPath", priority=10, type="joints", data=path)
if planned.get("value") is not True:
    sys.exit(f"refused: {planned}")
while ask("getStatus")["isTrajectoryRunning"]["value"]:
    time.sleep(0.1)
print("joints", [round(q, 3) for q in ask("getStatus")["jointPositions"]["value"]])
print("given back:", ask("unlockControl", priority=10))
