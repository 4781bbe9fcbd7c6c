"""A standard move over HTTP, followed over the WebSocket.

python examples/01_standard_move.py http://localhost:8090 5.5 7.5
"""

import json
import sys
import urllib.request

from websockets.sync.client import connect

url, x, y = sys.argv[1], float(sys.argv[2]), float(sys.argv[3])
body = json.dumps({"type": "standard", "target_x": x, "target_y": y}).encode()
request = urllib.request.Request(f"{url}/chassis/moves", body, {"Content-Type": "application/json"})
move = json.load(urllib.request.urlopen(request, timeout=30))

with connect(url.replace("http", "ws", 1) + "/ws/v2/topics") as socket:
    socket.send(json.dumps({"enable_topic": "/planning_state"}))
    for frame in socket:
        state = json.loads(frame)
        if state.get("action_id") != move["id"]:
            continue
        print(f"{state['move_state']}, {state['remaining_distance']:.2f} m to go")
        if state["move_state"] in ("succeeded", "failed", "cancelled"):
            break

move = json.load(urllib.request.urlopen(f"{url}/chassis/moves/{move['id']}", timeout=30))
print(move["state"], move["fail_message"])
sys.exit(move["state"] != "succeeded")
