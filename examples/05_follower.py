"""The robot follows a target that this program sees: one that walks along the aisle, and is reported where it is.

python examples/05_follower.py http://localhost:8090 5.5 9.0
"""

import json
import sys
import urllib.request

from websockets.sync.client import connect

URL, START, END = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
Y, STEP = 7.4, 0.1  # m: the aisle, and how far the target walks between two reports


def call(method: str, path: str, body: dict | None = None) -> dict:
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(URL + path, data, {"Content-Type": "application/json"}, method=method)
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.load(answer)


call("POST", "/chassis/moves", {"type": "follow_target"})
with connect(URL.replace("http", "ws", 1) + "/ws/v2/topics") as socket:
    socket.send(json.dumps({"enable_topic": "/tracked_pose"}))
    target = START
    for frame in socket:
        pose = json.loads(frame)
        if pose.get("topic") != "/tracked_pose":
            continue
        x, y = pose["pos"]
        apart = ((x - target) ** 2 + (y - Y) ** 2) ** 0.5
        if target >= END and apart < 1.4:
            print(f"target at ({target:.2f}, {Y:.2f}), robot at ({x:.2f}, {y:.2f}), {apart:.2f} m from it")
            break
        if apart < 2.0:  # it waits for a robot that is far behind
            target = min(target + STEP, END)
        report = {"follow_state": "follow_pose", "target_pose": {"pos": [target, Y]}}
        socket.send(json.dumps({"topic": "/follow_target_state", **report}))
print(call("PATCH", "/chassis/moves/current", {"state": "cancelled"})["state"])
