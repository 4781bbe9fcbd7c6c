"""The worked examples are what they are said to be, and there is one for everything."""

from __future__ import annotations

import json
from typing import Any

import pytest

from rackhand.schemas import crf_examples
from rackhand.schemas import crf_requests as crf
from rackhand.schemas.motion import ControlInfo, Reply
from rackhand.services.controller.commands.table import COMMANDS
from rackhand.services.controller.protocol.answers import Answer
from rackhand.services.controller.protocol.parse import parse
from tests.controller.cell import UR5E, PerfectArm
from tests.controller.protocol.bench import ARM
from tests.gateway.harness import new_app


@pytest.mark.parametrize("request_", crf_examples.REQUESTS.values(), ids=crf_examples.REQUESTS)
def test_an_example_is_a_request_of_the_protocol(request_: dict[str, Any]) -> None:
    parsed = parse(json.dumps(request_), UR5E.n, COMMANDS)
    assert not isinstance(parsed.result, Answer), parsed.result
    assert COMMANDS.of(parsed.result).check(parsed.result, ARM) == ""


def test_a_controller_takes_them_all() -> None:
    """In their order, paths included; what a test arm lacks is the gripper."""
    arm = PerfectArm()
    for name, request in crf_examples.REQUESTS.items():
        ticket = arm.send("a", json.dumps(request))
        arm.advance(request.get("keepAlive", 0.0) + 0.004)
        if request["command"] == "appendPath":
            arm.until_rest(60.0)
            arm.send(
                "a", json.dumps({**crf_examples.REQUESTS["path of joints"], "data": [UR5E.home.tolist()], "id": name})
            )
            arm.until_rest(60.0)
        answer = arm.answers[ticket]
        assert answer["replyCommand"] == request["command"], f"{name}: {answer}"
        message = answer["message"]
        assert not isinstance(message, dict) or message.get("code", 200) in (200, 405), f"{name}: {answer}"


def test_there_is_one_for_every_command_representation_method_and_frame() -> None:
    said = {request["command"] for request in crf_examples.REQUESTS.values()}
    assert said == {crf.words(model)[0] for model in crf.REQUESTS}
    poses = [p for r in crf_examples.REQUESTS.values() if r.get("type") == "task" and r["command"] == "appendPath"
             for p in r["data"]]  # fmt: skip
    forms = {key for pose in poses for key in pose.get("Orientation", {"legacy": 0})}
    assert forms == {"Quaternion", "Matrix", "AngleAxis", "CardanXYZ", "EulerZXZ", "legacy"}
    for field in ("method", "reference"):
        assert {r[field] for r in crf_examples.REQUESTS.values() if field in r} == {1, 2}
    for command in ("appendPath", "setVelocity", "setTorque", "setProfileVelocity", "setProfileAcceleration"):
        assert {r["type"] for r in crf_examples.REQUESTS.values() if r["command"] == command} == {"joints", "task"}


@pytest.mark.parametrize("answer", crf_examples.ANSWERS.values(), ids=crf_examples.ANSWERS)
def test_an_example_of_an_answer_is_one(answer: dict[str, Any]) -> None:
    Reply.model_validate(answer, by_alias=True)
    if answer["replyCommand"] == "controlLost":
        ControlInfo.model_validate(answer["message"], by_alias=True)


def test_the_openapi_document_shows_them() -> None:
    document = new_app().openapi()
    operation = document["paths"]["/motion/{arm}/command"]["post"]
    shown = operation["requestBody"]["content"]["application/json"]["examples"]
    assert {name: example["value"] for name, example in shown.items()} == crf_examples.REQUESTS
    assert "/motion/{arm}/ws" in operation["description"]
