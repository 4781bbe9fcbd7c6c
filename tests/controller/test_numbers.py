"""Every number of every request, at its edges: the protocol's own answer, and the arm is as good as before."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.controller.cell import UR5E, PerfectArm, moved, pose

HOME = UR5E.home.tolist()
TOOL = pose(moved(PerfectArm().tool(), 0.02, 0.0, 0.0))
QUATERNION = {"Position": [0.3, 0.1, 0.5], "Orientation": {"Quaternion": {"W": 1.0, "X": 0.0, "Y": 0.0, "Z": 0.0}}}
AXIS = {"Position": [0.3, 0.1, 0.5], "Orientation": {"AngleAxis": {"Angle": 0.2, "Axis": [1.0, 0.0, 0.0]}}}
CARDAN = {"Position": [0.3, 0.1, 0.5], "Orientation": {"CardanXYZ": {"X": 0.1, "Y": 0.0, "Z": 0.0}}}
EULER = {"Position": [0.3, 0.1, 0.5], "Orientation": {"EulerZXZ": {"Z1": 0.1, "X": 0.0, "Z2": 0.0}}}
LEGACY = {"data": [0.3, 0.1, 0.5, 0.1, 0.0, 0.0], "representation": 1}
OBJECTIVE = {"enable": True, "c": 1.0, "p": 0.1, "blend": 0.2}
SPHERE = {"enable": True, "c": 1.0, "center": [2.0, 2.0, 2.0], "radius": 0.1, "blend": 0.2}
FUNCTIONS = {"JointLimits": OBJECTIVE, "CollisionAvoidanceSphere": [SPHERE]}
P = {"priority": 10}

REQUESTS: list[dict[str, Any]] = [
    {"command": "lockControl", **P, "keepAlive": 5.0},
    {"command": "unlockControl", **P},
    {"command": "startHeartbeat", "period": 1.0},
    {"command": "startStreamStatus", "frequency": 10.0, "mode": 1},
    {"command": "startStreamStatus", "frequency": 10, "mode": 2},
    {"command": "softStop", **P},
    {"command": "appendPath", **P, "type": "joints", "data": [HOME], "leaseId": 1},
    {"command": "appendPath", **P, "type": "task", "method": 1, "reference": 1, "data": [TOOL]},
    {"command": "appendPath", **P, "type": "task", "method": 2, "reference": 1, "data": [TOOL]},
    {"command": "appendPath", **P, "type": "task", "method": 2, "reference": 1, "data": [QUATERNION]},
    {"command": "appendPath", **P, "type": "task", "method": 1, "reference": 2, "data": [AXIS]},
    {"command": "appendPath", **P, "type": "task", "method": 1, "reference": 1, "data": [CARDAN]},
    {"command": "appendPath", **P, "type": "task", "method": 1, "reference": 1, "data": [EULER]},
    {"command": "appendPath", **P, "type": "task", "method": 1, "reference": 1, "data": [LEGACY]},
    {"command": "setVelocity", **P, "type": "joints", "data": [0.1] * 6, "sequence": 1, "stamp": 0, "timeout": 0.05},
    {"command": "setVelocity", **P, "type": "task", "data": [0.01] * 6, "reference": 1},
    {"command": "setTorque", **P, "type": "joints", "data": [0.1] * 6, "sequence": 1, "stamp": 0, "timeout": 0.05},
    {"command": "setTorque", **P, "type": "task", "data": [0.1] * 6, "reference": 2},
    {"command": "setProfileVelocity", **P, "type": "joints", "data": [0.5] * 6},
    {"command": "setProfileVelocity", **P, "type": "task", "data": [0.2] * 6},
    {"command": "setProfileAcceleration", **P, "type": "joints", "data": [1.0] * 6},
    {"command": "setProfileAcceleration", **P, "type": "task", "data": [1.0] * 6},
    {"command": "setParameters", **P, "data": {"Controller": {"ObjectiveFunctions": FUNCTIONS}}},
    {
        "command": "setParameters", **P,
        "data": {"Controller": {
            "DesiredJointPosition": {"AttractionPosition": HOME},
            "ObjectiveFunctions": {"DesiredJointPositions": OBJECTIVE, "Manipulability": {"enable": True, "c": 1.0}},
        }},
    },
]  # fmt: skip
# As JSON has them: what is no number, what a double cannot hold, what it hardly can.
EDGES = (
    "0", "-0.0", "-1", "1e-320", "-1e-320", "5e-324", "1e-200", "1e-12", "1e12", "1e200", "1e308", "-1e308",
    "1" + "0" * 400, "9223372036854775808", "-9223372036854775809", "1.5", "true", "false", "null", '"1"', '"NaN"',
    '"inf"', '"-inf"', "[]",
)  # fmt: skip
HERE = "@here@"


def numbers(value: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Where in a request numbers stand; of the joints or axes of a vector the first stands for all."""
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from numbers(inner, (*path, key))
    elif isinstance(value, list):
        yield from numbers(value[0], (*path, 0))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def put(request: dict[str, Any], path: tuple[Any, ...], text: str) -> str:
    changed: Any = copy.deepcopy(request)
    inner = changed
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = HERE
    return json.dumps(changed).replace(f'"{HERE}"', text)


CASES = [
    pytest.param(request, path, id=f"{request['command']}-{'.'.join(map(str, path))}-{i}")
    for i, request in enumerate(REQUESTS)
    for path in numbers(request)
]


@pytest.mark.parametrize(("request_", "path"), CASES)
def test_a_number_at_its_edges_gets_the_protocols_answer(request_: dict[str, Any], path: tuple[Any, ...]) -> None:
    for edge in EDGES:
        arm = PerfectArm()
        text = put(request_, path, edge)
        ticket = arm.send("a", text)
        arm.advance(0.2)
        assert ticket in arm.answers, text
        answer = arm.answers[ticket]
        message = answer["message"]
        assert answer["replyCommand"] in ("error", request_["command"]), text
        code = message.get("code") if isinstance(message, dict) else message
        assert code != 500 and arm.errors == [], f"{text}: {answer} {arm.errors}"
        assert answer.get("text") or message is True or code == 200, f"{text}: no reason is given"
        assert arm.send("b", json.dumps({"command": "softStop"})) in arm.answers
        arm.until_rest(2.0)
        q, dq = arm.driven()
        assert np.isfinite(q).all() and np.isfinite(dq).all(), text
