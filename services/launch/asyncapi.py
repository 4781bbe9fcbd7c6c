"""The AsyncAPI 3 document of the contract: bus topics and queries, and the gateway's chassis WebSocket.

Generated from ``schemas/topics.py``; schemas are those of the pydantic models. Specification:
https://www.asyncapi.com/docs/reference/specification/v3.0.0
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from rackhand.schemas import topics
from rackhand.schemas import websocket as ws
from rackhand.schemas.codec import MEDIA_TYPE
from rackhand.schemas.refusal import Refusal
from rackhand.schemas.topics import Query, Topic

Json = dict[str, Any]

WS_PATH = "/ws/v2/topics"
# What the gateway sends without its topic having been enabled, by the topic of the frame; and what it takes.
_UNREQUESTED: dict[str, type[BaseModel]] = {
    "/ws_connections": ws.Connections,
    "/ws_connection_established": ws.Connection,
    "/ws_connection_disconnected": ws.Connection,
    "/twist_feedback": ws.Empty,
    "/error": ws.Error,
}
_FROM_CLIENTS: dict[str, type[BaseModel]] = {
    "/twist": ws.Twist,
    "/follow_target_state": ws.FollowTargetState,
}
_NAMES = {
    "chassis": "name of a mobile robot, as in amr1",
    "arm": "name of an arm, as in arm1",
    "lift": "name of a lift, as in lift_1",
    "any": "name of a robot, or world, or cell",
}
_INFO = (
    "Topics and queries of the cell on Zenoh, and the topics of the gateway's chassis WebSocket. Bus payloads are "
    "MessagePack maps; binary strings hold little-endian numbers (`dtype`, `shape`). Stamps are nanoseconds of "
    "`rackhand/world/clock`; units are SI, angles in radians."
)


def document() -> Json:
    """The whole document. Channels are named as topics are, with dots for slashes."""
    refs, schemas = _schemas()
    messages, channels, operations = _Messages(refs), {}, {}
    for topic in topics.TOPICS:
        channels[_id(topic.name)] = _topic_channel(topic, messages)
        operations[f"publish.{_id(topic.name)}"] = _operation("send", topic.name, f"published by {topic.publisher}")
    for query in topics.QUERIES:
        channels |= _query_channels(query, messages)
        operations[f"answer.{_id(query.name)}"] = _query_operation(query)
    channels["websocket"] = _websocket_channel(messages)
    operations |= _websocket_operations()
    return {
        "asyncapi": "3.0.0",
        "info": {"title": "rackhand", "version": "1", "description": _INFO, "license": {"name": "MIT"}},
        "defaultContentType": MEDIA_TYPE,
        "servers": {
            "bus": {"host": "127.0.0.1:7447", "protocol": "zenoh", "description": "the router of the cell"},
            "gateway": {"host": "localhost:8090", "protocol": "ws", "description": "the gateway"},
        },
        "channels": channels,
        "operations": operations,
        "components": {"messages": messages.found, "schemas": schemas},
    }


def text() -> str:
    """The document as it is committed."""
    return json.dumps(document(), indent=1, ensure_ascii=False) + "\n"


class _Messages:
    """The messages that channels refer to, by name."""

    def __init__(self, refs: dict[type[BaseModel], Json]) -> None:
        self._refs = refs
        self.found: dict[str, Json] = {}

    def refer(self, model: type[BaseModel], topic: str = "") -> dict[str, Json]:
        """A channel's entry of a message; a WebSocket frame has its ``topic`` beside the model's fields."""
        name = _id(topic.strip("/")) if topic else _name(model)
        payload = self._refs[model]
        if topic:
            head = {"type": "object", "properties": {"topic": {"const": topic}}, "required": ["topic"]}
            payload = {"allOf": [head, payload]}
        key = f"frame.{name}" if topic else name
        self.found[key] = {
            "name": key,
            "title": model.__name__,
            "summary": " ".join((model.__doc__ or "").split("\n\n")[0].split()),
            "contentType": "application/json" if issubclass(model, ws.Frame | ws.ClientFrame) else MEDIA_TYPE,
            "payload": payload,
        }
        return {key: {"$ref": f"#/components/messages/{key}"}}


def _topic_channel(topic: Topic[Any], messages: _Messages) -> Json:
    return {
        **_channel(topic, messages.refer(topic.model)),
        "x-rackhand": {
            "publisher": topic.publisher,
            "readers": list(topic.readers),
            "rateHz": topic.rate,
            "qos": topic.qos.value,
            "websocket": [view.TOPIC for view in topic.ws],
        },
    }


def _query_channels(query: Query[Any, Any], messages: _Messages) -> dict[str, Json]:
    roles = {"server": query.server, "callers": list(query.callers)}
    answers = messages.refer(query.reply) | messages.refer(Refusal)
    return {
        _id(query.name): {**_channel(query, messages.refer(query.request)), "x-rackhand": roles},
        f"{_id(query.name)}.reply": _channel(query, answers),
    }


def _channel(row: Topic[Any] | Query[Any, Any], messages: dict[str, Json]) -> Json:
    parameters = {"parameters": {"robot": {"description": _NAMES[row.owner]}}} if row.owner != "world" else {}
    return {
        "address": row.key,
        "description": row.text,
        "servers": [{"$ref": "#/servers/bus"}],
        **parameters,
        "messages": messages,
    }


def _operation(action: str, name: str, summary: str) -> Json:
    return {"action": action, "summary": summary, "channel": {"$ref": f"#/channels/{_id(name)}"}}


def _query_operation(query: Query[Any, Any]) -> Json:
    reply = {"channel": {"$ref": f"#/channels/{_id(query.name)}.reply"}}
    return {**_operation("receive", query.name, f"answered by {query.server}"), "reply": reply}


def _websocket_channel(messages: _Messages) -> Json:
    frames: dict[str, Json] = {}
    for view in topics.websocket_topics():
        frames |= messages.refer(view, view.TOPIC)
    for topic, model in {**_UNREQUESTED, **_FROM_CLIENTS}.items():
        frames |= messages.refer(model, topic)
    for model in (ws.EnabledTopics, ws.Subscription):
        frames |= messages.refer(model)
    return {
        "address": WS_PATH,
        "description": "JSON frames; the same for another robot of the fleet under /robots/{name}/ws/v2/topics",
        "servers": [{"$ref": "#/servers/gateway"}],
        "messages": frames,
    }


def _websocket_operations() -> dict[str, Json]:
    """Each frame is sent or received on the one channel."""
    taken = [*(f"frame.{_id(topic.strip('/'))}" for topic in _FROM_CLIENTS), _name(ws.Subscription)]
    sent = [*(view.TOPIC for view in topics.websocket_topics()), *_UNREQUESTED]
    names = [*(f"frame.{_id(topic.strip('/'))}" for topic in sent), _name(ws.EnabledTopics)]
    return {
        "websocket.send": _websocket_operation("send", "sent to clients that enabled the topic", names),
        "websocket.receive": _websocket_operation("receive", "sent by clients", taken),
    }


def _websocket_operation(action: str, summary: str, names: Iterable[str]) -> Json:
    refs = [{"$ref": f"#/channels/websocket/messages/{name}"} for name in names]
    return {**_operation(action, "websocket", summary), "messages": refs}


def _schemas() -> tuple[dict[type[BaseModel], Json], Json]:
    """A reference to the schema of each model of the contract, and all schemas by name."""
    models: list[type[BaseModel]] = [Refusal, ws.EnabledTopics, ws.Subscription]
    models += [topic.model for topic in topics.TOPICS] + [*_UNREQUESTED.values(), *_FROM_CLIENTS.values()]
    models += [model for query in topics.QUERIES for model in (query.request, query.reply)]
    models += topics.websocket_topics()
    unique = list(dict.fromkeys(models))
    refs, definitions = models_json_schema(
        [(model, "validation") for model in unique], ref_template="#/components/schemas/{model}"
    )
    schemas = {name: _draft_7(schema) for name, schema in definitions["$defs"].items()}
    for model in unique:
        if issubclass(model, ws.Frame):  # its topic is beside the fields, and readers ignore what they do not know
            schemas[refs[model, "validation"]["$ref"].rpartition("/")[2]].pop("additionalProperties", None)
    return {model: refs[model, "validation"] for model in unique}, dict(sorted(schemas.items()))


def _draft_7(schema: Any) -> Any:
    """A schema as AsyncAPI's own dialect has it: tuples as lists of ``items``, the discriminator as its name."""
    if isinstance(schema, list):
        return [_draft_7(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    found = {("items" if key == "prefixItems" else key): _draft_7(value) for key, value in schema.items()}
    if isinstance(discriminator := found.get("discriminator"), dict):
        found["discriminator"] = discriminator["propertyName"]
    return found


def _name(model: type[BaseModel]) -> str:
    return f"{model.__module__.removeprefix('rackhand.schemas.')}.{model.__name__}"


def _id(name: str) -> str:
    return name.replace("/", ".")
