"""Malformed bodies and frames by the thousand: always an answer, never a 500, never a traceback.

``RACKHAND_FUZZ_EXAMPLES`` sets how many there are in all (200 if not given; tests/system makes 10,000).
"""

from __future__ import annotations

import json
import os
import string
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rackhand.bus import CallTimeout, Refused, Unavailable
from rackhand.schemas.refusal import RefusalCode
from tests.gateway.harness import Gateway, Socket, map_body
from tests.gateway.ws.test_websocket import client_frame, raw_websocket

# The server, in its own thread, draws random numbers while hypothesis draws examples, which takes them for its own.
pytestmark = pytest.mark.filterwarnings("ignore:Do not use the `random` module inside strategies")

EXAMPLES = int(os.environ.get("RACKHAND_FUZZ_EXAMPLES", "200"))
thorough = settings(
    max_examples=max(EXAMPLES // 2, 1),
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture, HealthCheck.data_too_large],
)
few = settings(thorough, max_examples=max(EXAMPLES // 20, 1))

scalars = (
    st.none()
    | st.booleans()
    | st.integers()
    | st.integers(min_value=2**63, max_value=2**70)
    | st.floats()
    | st.text(max_size=20)
    | st.sampled_from(["standard", "cancelled", "auto", "1", "0, 0, 1, 1", "NaN", "\ud800", "\0", {}, []])
)
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4),
    max_leaves=12,
)
BODIES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("POST", "/chassis/moves", {"type": "standard", "target_x": 1.0, "target_y": 2.0, "target_ori": 0.0,
                                "target_accuracy": 0.1, "route_coordinates": "0,0", "detour_tolerance": 0,
                                "use_target_zone": True, "charge_retry_count": 1, "rack_area_id": "a",
                                "properties": {"inplace_rotate": True}, "creator": "fuzz"}),
    ("PATCH", "/chassis/moves/current", {"state": "cancelled"}),
    ("PATCH", "/chassis/moves/1", {"state": "cancelled"}),
    ("POST", "/chassis/pose", {"position": [1, 2, 0], "ori": 1.0, "adjust_position": True}),
    ("POST", "/chassis/current-map", {"map_id": 1, "map_uid": "a", **map_body(overlays="{}")}),
    ("POST", "/maps", map_body(overlays="{}", uid="a")),
    ("PATCH", "/maps/1", {"map_name": "a", "overlays": "{}"}),
    ("POST", "/services/wheel_control/set_control_mode", {"control_mode": "auto", "mode": "auto"}),
    ("POST", "/services/wheel_control/set_emergency_stop", {"enable": True}),
    ("POST", "/services/jack_up", {}),
)  # fmt: skip
FRAMES: tuple[dict[str, Any], ...] = (
    {"enable_topic": "/map"},
    {"disable_topic": ["/map"], "enable_topic": ["/path", "/alerts"]},
    {"topic": "/twist", "linear_velocity": 0.1, "angular_velocity": 0.2},
    {"topic": "/get_device_info_brief"},
)
CONTENT_TYPES = (
    "application/json",
    "application/json",
    "application/json",
    None,
    "text/plain",
    "x",
    "multipart/form-data",
)


@st.composite
def spoilt(draw: st.DrawFn, fields: dict[str, Any]) -> bytes:
    """A right object with something wrong: a field replaced or gone, a byte changed or cut off; or no object at all."""
    value: Any = dict(fields)
    for name in draw(st.lists(st.sampled_from(sorted(fields) or ["x"]), max_size=3)):
        if draw(st.booleans()):
            value[name] = draw(values)
        else:
            value.pop(name, None)
    if draw(st.integers(0, 9)) == 0:
        value = draw(values)
    text = json.dumps(value).encode()
    match draw(st.sampled_from(["whole", "whole", "cut", "byte", "bytes", "deep", "twice", "bare"])):
        case "cut":
            return text[: draw(st.integers(0, len(text)))]
        case "byte":
            at = draw(st.integers(0, len(text)))
            return text[:at] + draw(st.binary(max_size=3)) + text[at + 1 :]
        case "bytes":
            return draw(st.binary(max_size=64))
        case "deep":
            return b"[" * draw(st.sampled_from([10, 199, 201, 5000])) + text
        case "twice":
            return b"{" + b",".join([text.strip(b"{}")] * 2) + b"}"
        case "bare":
            return text.replace(b'"', b"", draw(st.integers(0, 8)))
    return text


@st.composite
def requests(draw: st.DrawFn) -> tuple[str, str, str | None, bytes]:
    method, path, fields = draw(st.sampled_from(BODIES))
    return method, path, draw(st.sampled_from(CONTENT_TYPES)), draw(spoilt(fields))


frames = st.sampled_from(FRAMES).flatmap(spoilt)


@thorough
@given(request=requests())
def test_malformed_bodies(server: Gateway, request: tuple[str, str, str | None, bytes]) -> None:
    method, path, kind, content = request
    answer = server.http.request(method, path, content=content, headers={} if kind is None else {"content-type": kind})
    assert answer.status_code in (200, 201, 400, 404, 415)
    assert "Traceback" not in answer.text
    body = answer.json()
    if answer.status_code == 400:
        assert body
        assert (isinstance(body, list) and all(isinstance(text, str) for text in body)) or list(body) == ["detail"]


@thorough
@given(frame=frames)
def test_malformed_frames(listening: Socket, frame: bytes) -> None:
    """Every frame is answered, and so is the next."""
    try:
        text: str | bytes = frame.decode()
    except UnicodeDecodeError:
        text = frame
    listening.send(text)
    listening.send({"enable_topic": "/canary", "disable_topic": ["/map", "/path", "/alerts"]})
    answers = [listening.receive(), listening.receive()]
    assert "/canary" in answers[1].get("enabled_topics", [])
    assert "Traceback" not in json.dumps(answers)


@pytest.fixture(scope="module")
def listening(server: Gateway) -> Any:
    server.reset()
    with server.websocket() as client:
        yield client


@few
@given(
    noise=st.binary(min_size=1, max_size=200),
    opcode=st.integers(0, 15),
    framed=st.booleans(),
)
def test_noise_below_the_protocol_ends_that_connection_and_no_other(
    server: Gateway, noise: bytes, opcode: int, framed: bool
) -> None:
    raw = raw_websocket(server.port)
    with suppress(ConnectionError):
        raw.sendall(client_frame(noise, opcode) if framed else noise)
    raw.close()
    assert server.http.get("/device/boot_progress").status_code == 200


def escaped(text: str) -> str:
    return "".join(letter if letter.isalnum() else f"%{ord(letter):02x}" for letter in text)


@few
@given(
    path=st.text(string.printable, max_size=60),
    query=st.text(string.printable, max_size=40),
    method=st.sampled_from(["GET", "POST", "PATCH", "DELETE", "PUT", "HEAD", "OPTIONS", "TRACE"]),
    accept=st.sampled_from(["*/*", "text/html", "application/json", "text/", ""]),
    root=st.sampled_from(["/", "/maps/", "/chassis/moves/", "/chassis/moves?limit=", "/page/", "/services/"]),
)
def test_odd_urls(server: Gateway, path: str, query: str, method: str, accept: str, root: str) -> None:
    url = f"{root}{escaped(path)}?{escaped(query)}"
    answer = server.http.request(method, url, headers={"accept": accept})
    assert answer.status_code < 500
    assert "Traceback" not in answer.text


@pytest.mark.parametrize("failure", [Unavailable("gone"), CallTimeout("late"), Refused(RefusalCode.INTERNAL, "why")])
def test_no_failure_of_the_bus_shows_a_traceback(gateway: Gateway, failure: Any) -> None:
    gateway.bus.failure = failure
    for method, path, fields in BODIES:
        answer = gateway.http.request(method, path, json=fields)
        assert answer.status_code in ((503,) if not isinstance(failure, Refused) else (500,))
        assert list(answer.json()) == ["detail"]
