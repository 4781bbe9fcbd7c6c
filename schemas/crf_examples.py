"""One worked example of every request of a CRF client to a six-joint arm, and of every kind of answer.

The OpenAPI document, ``rackhand motion --help`` and the manual show these; a test has the protocol accept each.
"""

from __future__ import annotations

from typing import Any

Example = dict[str, Any]

_HOME = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0]
_AT = [-0.45, -0.2, 0.4]
_DOWN = {"Quaternion": {"W": 0.0, "X": 1.0, "Y": 0.0, "Z": 0.0}}


def _path(orientation: Example) -> Example:
    pose = {"Position": _AT, "Orientation": orientation}
    return {"command": "appendPath", "priority": 10, "type": "task", "method": 2, "reference": 1, "data": [pose]}


REQUESTS: dict[str, Example] = {
    "lock": {"command": "lockControl", "priority": 10, "id": 1},
    "lock by name, for half a second": {
        "command": "lockControl", "priority": 10, "client": "picker", "keepAlive": 0.5, "onLoss": "softStop",
        "user": {"name": "ann", "role": "operator"},
    },
    "unlock": {"command": "unlockControl", "priority": 10},
    "resume after another client's stop": {"command": "resumeControl", "priority": 10},
    "path of joints": {
        "command": "appendPath", "priority": 10, "type": "joints", "data": [_HOME, [0.3, *_HOME[1:]]], "id": "p1",
    },
    "path of the tool, straight lines": _path(_DOWN),
    "path of the tool, joints move": {**_path(_DOWN), "method": 1},
    "path from where the tool is": {
        **_path({}), "reference": 2,
        "data": [{"Position": [0, 0, 0.05], "Orientation": {"CardanXYZ": {"X": 0, "Y": 0, "Z": 0.3}}}],
    },
    "orientation as a quaternion": _path(_DOWN),
    "orientation as a matrix": _path({"Matrix": {"Row1": [1, 0, 0], "Row2": [0, -1, 0], "Row3": [0, 0, -1]}}),
    "orientation as angle and axis": _path({"AngleAxis": {"Angle": 3.141592653589793, "Axis": [1, 0, 0]}}),
    "orientation as roll, pitch, yaw": _path({"CardanXYZ": {"X": 3.141592653589793, "Y": 0, "Z": 0}}),
    "orientation as Euler angles": _path({"EulerZXZ": {"Z1": 0, "X": 3.141592653589793, "Z2": 0}}),
    "pose in the older form": {
        **_path(_DOWN), "data": [{"data": [*_AT, 3.141592653589793, 0, 0], "representation": 1}],
    },
    "velocity of joints": {"command": "setVelocity", "priority": 10, "type": "joints", "data": [0.1, 0, 0, 0, 0, 0]},
    "velocity of the tool, base axes": {
        "command": "setVelocity", "priority": 10, "type": "task", "reference": 1, "data": [0.05, 0, 0, 0, 0, 0],
    },
    "velocity of the tool, its own axes, late samples detected": {
        "command": "setVelocity", "priority": 10, "type": "task", "reference": 2, "data": [0, 0, 0.02, 0, 0, 0.1],
        "sequence": 17, "timeout": 0.05,
    },
    "torque of joints": {"command": "setTorque", "priority": 10, "type": "joints", "data": [0, 0, 0, 0, 0, 0.5]},
    "force at the tool": {
        "command": "setTorque", "priority": 10, "type": "task", "reference": 1, "data": [0, 0, -5, 0, 0, 0],
    },
    "profile velocity of joints": {
        "command": "setProfileVelocity", "priority": 10, "type": "joints", "data": [0.5] * 6,
    },
    "profile velocity of the tool": {
        "command": "setProfileVelocity", "priority": 10, "type": "task", "data": [0.25, 0.25, 0.25, 1, 1, 1],
    },
    "profile acceleration of joints": {
        "command": "setProfileAcceleration", "priority": 10, "type": "joints", "data": [2.0] * 6,
    },
    "profile acceleration of the tool": {
        "command": "setProfileAcceleration", "priority": 10, "type": "task", "data": [1, 1, 1, 4, 4, 4],
    },
    "soft stop": {"command": "softStop"},
    "hard stop": {"command": "hardStop"},
    "parameters": {
        "command": "setParameters", "priority": 10,
        "data": {"Controller": {
            "StopConditions": {"StopOnLowManipulability": True},
            "DesiredJointPosition": {"AttractionPosition": [0.0, "NaN", "NaN", "NaN", "NaN", "NaN"]},
            "ObjectiveFunctions": {
                "JointLimits": {"enable": True, "blend": 1.0},
                "CollisionAvoidanceSphere": {"enable": True, "center": [0.6, 0.3, 0.2], "radius": 0.1},
            },
        }},
    },
    "gripper": {"command": "setGripper", "priority": 10, "suction": True},
    "joints controlled without motion": {"command": "startJointsControl", "priority": 10},
    "tool controlled without motion": {"command": "startTaskControl", "priority": 10},
    "status": {"command": "getStatus"},
    "configuration": {"command": "getConfiguration"},
    "stream (WebSocket, TCP)": {"command": "startStreamStatus", "frequency": 20},
    "stream of changes (WebSocket, TCP)": {"command": "startStreamStatus", "frequency": 20, "mode": 2},
    "end of the stream": {"command": "stopStreamStatus"},
    "heartbeat every half second": {"command": "startHeartbeat", "period": 0.5},
    "beat": {"command": "heartbeat"},
    "end of the heartbeat": {"command": "stopHeartbeat"},
}  # fmt: skip

ANSWERS: dict[str, Example] = {
    "locked": {"command": "reply", "replyCommand": "lockControl", "message": True, "id": 1},
    "done": {"command": "reply", "replyCommand": "appendPath", "message": {"value": True, "code": 200, "detail": 0}},
    "held by another client": {
        "command": "reply", "replyCommand": "appendPath", "message": {"code": 403, "detail": 0},
        "text": "#5f0c2a9b71d3e846 holds priority 5",
    },
    "cannot be done": {
        "command": "reply", "replyCommand": "appendPath", "message": {"code": 400, "detail": 0},
        "text": "data[0] has 5 numbers, the arm 6 joints",
    },
    "malformed": {
        "command": "reply", "replyCommand": "error", "message": 400, "text": "priority: Field required", "id": 7,
    },
    "unknown": {"command": "reply", "replyCommand": "error", "message": "Unknown command: foo", "id": 7},
    "event (WebSocket, TCP)": {
        "command": "reply", "replyCommand": "controlLost",
        "message": {
            "client": "picker", "priority": 10, "leaseId": 3, "epoch": "92518cd73a4c6472", "by": "pendant",
            "byPriority": 1, "reason": "preempted",
        },
    },
}  # fmt: skip
