"""The AsyncAPI document: its structure, its references, and real messages and frames against its schemas."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import jsonschema_rs
import pytest
from typer.testing import CliRunner

from rackhand.schemas import topics
from rackhand.schemas.base import Message, Pose2
from rackhand.schemas.chassis import Contacts
from rackhand.schemas.topics import QUERIES, TOPICS, Qos, Topic, websocket_topics
from rackhand.schemas.websocket import WsTopic
from rackhand.services.gateway.ws.broadcast import frame
from rackhand.services.gateway.ws.facts import Facts
from rackhand.services.gateway.ws.payloads import PAYLOADS
from rackhand.services.launch import asyncapi
from rackhand.services.launch.cli import app
from tests.gateway import messages

DOCUMENT = asyncapi.document()


def nodes(value: Any) -> Iterator[dict[str, Any]]:
    if isinstance(value, dict):
        yield value
    for child in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from nodes(child)


def resolve(reference: str, document: Any = DOCUMENT) -> Any:
    found = document
    for part in reference.removeprefix("#/").split("/"):
        found = found[part]
    return found


def test_the_command_prints_it() -> None:
    result = CliRunner().invoke(app, ["topics", "--asyncapi"])
    assert result.exit_code == 0
    assert json.loads(result.output) == json.loads(asyncapi.text())


def test_required_parts_are_there_and_names_are_as_the_specification_wants() -> None:
    assert DOCUMENT["asyncapi"] == "3.0.0" and {"title", "version"} <= set(DOCUMENT["info"])
    for group in ("messages", "schemas"):
        assert all(re.fullmatch(r"[A-Za-z0-9._-]+", name) for name in DOCUMENT["components"][group])
    for operation in DOCUMENT["operations"].values():
        assert operation["action"] in ("send", "receive") and set(operation["channel"]) == {"$ref"}
    for channel in DOCUMENT["channels"].values():
        assert set(re.findall(r"\{(\w+)\}", channel["address"])) == set(channel.get("parameters", {}))
        assert channel["messages"]


def test_every_reference_leads_somewhere() -> None:
    references = [node["$ref"] for node in nodes(DOCUMENT) if isinstance(node.get("$ref"), str)]
    assert len(references) > 200
    for reference in references:
        assert isinstance(resolve(reference), dict), reference


def test_an_operation_s_messages_are_those_of_its_channel() -> None:
    for operation in DOCUMENT["operations"].values():
        for message in operation.get("messages", ()):
            assert message["$ref"].startswith(operation["channel"]["$ref"] + "/messages/")


def test_every_topic_query_and_frame_is_in_it() -> None:
    addresses = [channel["address"] for channel in DOCUMENT["channels"].values()]
    assert {row.key for row in (*TOPICS, *QUERIES)} <= set(addresses)
    frames = DOCUMENT["channels"]["websocket"]["messages"]
    assert {f"frame.{view.TOPIC.strip('/').replace('/', '.')}" for view in websocket_topics()} <= set(frames)


def validator(name: str) -> Any:
    payload = DOCUMENT["components"]["messages"][name]["payload"]
    return jsonschema_rs.validator_for(
        {"$schema": "http://json-schema.org/draft-07/schema#", **payload, "components": DOCUMENT["components"]}
    )


def test_real_frames_fit_their_schemas_and_others_do_not() -> None:
    facts = Facts(
        {
            topics.POSE: messages.pose(), topics.ODOMETRY: messages.odometry(), topics.SCAN: messages.scan(),
            topics.PLANNING_STATE: messages.planning(), topics.PATH: messages.path(),
            topics.BATTERY: messages.battery(),
            topics.MAP: messages.current_map(), topics.CHASSIS_STATUS: messages.status(), topics.JACK: messages.jack(),
            topics.CHASSIS_MODEL: messages.model(), topics.COSTMAP: messages.costmap(),
            topics.FOOTPRINT: messages.footprint(), topics.LOAD: messages.load(),
            topics.DETECTED_RACK: messages.detected_rack(), topics.DETECTED_RACK_STATES: messages.rack_states(),
            topics.MAP_RACK_STATES: messages.rack_states(), topics.SEEN_RACKS: messages.seen_racks(),
        }
    )  # fmt: skip
    facts.add(topics.CONTACTS, Contacts(stamp=1, bumper_front=True))
    facts.lifts["lift_1"] = messages.lift()
    facts.mappings.begin(Pose2(x=0.0, y=0.0, yaw=0.0), 0)
    for view in websocket_topics():
        value = PAYLOADS[view.TOPIC](facts)
        assert value is not None
        sent = json.loads(frame(view.TOPIC, value))
        schema = validator(f"frame.{view.TOPIC.strip('/').replace('/', '.')}")
        schema.validate(sent)
        assert not schema.is_valid({**sent, "topic": "/other"})
        assert not schema.is_valid({"topic": view.TOPIC})


def test_real_messages_fit_their_schemas_and_others_do_not() -> None:
    for message in (messages.planning(), messages.battery(), messages.jack(), messages.odometry(), messages.clock()):
        value = message.model_dump(mode="json")
        schema = validator(f"{type(message).__module__.removeprefix('rackhand.schemas.')}.{type(message).__name__}")
        schema.validate(value)
        assert not schema.is_valid({**value, "unknown": 1})


class ToyReading(Message):
    value: float


class ToyFrame(WsTopic):
    """a toy value"""

    TOPIC = "/toy"

    value: float


def test_a_new_row_is_documented(monkeypatch: pytest.MonkeyPatch) -> None:
    row = Topic("chassis/toy", "rackhand/{robot}/chassis/toy", "chassis", ToyReading, "driver", (), 10, Qos.STREAM,
                "a toy", (ToyFrame,))  # fmt: skip
    monkeypatch.setattr(topics, "TOPICS", (*TOPICS, row))
    document = asyncapi.document()
    assert document["channels"]["chassis.toy"]["address"] == "rackhand/{robot}/chassis/toy"
    assert "frame.toy" in document["channels"]["websocket"]["messages"]
    assert "value" in resolve("#/components/schemas/ToyReading/properties", document)
