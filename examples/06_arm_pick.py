"""An arm picks a parcel from the table with its suction cup and sets it down beside: CRF requests over HTTP.

python examples/06_arm_pick.py http://localhost:8090
"""

import json
import math
import sys
import time
import urllib.request

URL = sys.argv[1]
BASE, HEIGHT = (17.55, 12.0, 2.29), 0.6  # the arm's base in the map (m, rad), and above the floor: worlds/warehouse
FROM, TO, LID = (17.81, 11.52), (18.05, 11.6), 0.8  # parcel_red, a free place on the table, and the height of its lid
CUP, PRESS, ABOVE = 0.12, 0.001, 0.15  # m: flange to the rim of the cup, pressed onto the lid, carried over the table
DOWN = {"Matrix": {"Row1": [0, 1, 0], "Row2": [1, 0, 0], "Row3": [0, 0, -1]}}


def ask(command: str, **fields: object) -> object:
    body = json.dumps({"command": command, "client": "example", **fields}).encode()
    request = urllib.request.Request(f"{URL}/motion/arm1/command", body, {"Content-Type": "application/json"})
    with urllib.request.urlopen(request, timeout=30) as answer:
        return json.load(answer)["message"]


def tool(x: float, y: float, above: float) -> dict:
    """A pose of the flange, in the frame of the base, with the cup pointing down ``above`` metres over the lid."""
    dx, dy, (cos, sin) = x - BASE[0], y - BASE[1], (math.cos(BASE[2]), math.sin(BASE[2]))
    height = LID + above + CUP - HEIGHT
    return {"Position": [dx * cos + dy * sin, dy * cos - dx * sin, height], "Orientation": DOWN}


def go(*poses: dict) -> None:
    """In a straight line from pose to pose."""
    planned = ask("appendPath", priority=10, type="task", data=list(poses), method=2, reference=1)
    if planned is not True and planned.get("value") is not True:
        sys.exit(f"refused: {planned}")
    while ask("getStatus")["isTrajectoryRunning"]["value"]:
        time.sleep(0.1)


def suction(on: bool) -> None:
    ask("setGripper", priority=10, suction=on)
    for _ in range(50):
        if ask("getStatus")["gripper"]["holding"] == on:
            print("holding" if on else "released")
            return
        time.sleep(0.1)
    sys.exit(f"suction is {'on' if on else 'off'}, and the cup {'holds nothing' if on else 'still holds'}")


if ask("lockControl", priority=10, keepAlive=60.0) is not True:
    sys.exit("another client holds the arm")
go(tool(*FROM, ABOVE), tool(*FROM, -PRESS))
suction(True)
go(tool(*FROM, ABOVE), tool(*TO, ABOVE), tool(*TO, 0.005))
suction(False)
go(tool(*TO, ABOVE))
print("given back:", ask("unlockControl", priority=10))
