"""What holds of every path: slashes, methods, bodies, secrets, origins, and the pages nobody asked for."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.services.gateway.settings import Settings
from tests.gateway.harness import Gateway, map_body, running_gateway

MOVE = {"target_ori": 1.0}
JSON = {"content-type": "application/json"}


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("GET", "/", None, 200),
        ("GET", "/chassis", None, 200),
        ("GET", "/services", None, 200),
        ("GET", "/chassis/moves", None, 200),
        ("POST", "/chassis/moves", MOVE, 201),
        ("GET", "/chassis/moves/1", None, 404),
        ("GET", "/chassis/moves/current", None, 404),
        ("PATCH", "/chassis/moves/current", {"state": "cancelled"}, 404),
        ("GET", "/chassis/current-map", None, 404),
        ("POST", "/chassis/current-map", {"map_id": 1}, 404),
        ("GET", "/chassis/pose", None, 200),
        ("POST", "/chassis/pose", {"position": [1, 2, 0], "ori": 1.57}, 200),
        ("POST", "/chassis/pose", {"position": [1.5, 2], "ori": 0, "adjust_position": True}, 200),
        ("GET", "/chassis/status", None, 503),
        ("GET", "/maps", None, 200),
        ("POST", "/maps", map_body(), 201),
        ("GET", "/maps/1", None, 404),
        ("GET", "/maps/1.png", None, 404),
        ("DELETE", "/maps/1", None, 404),
        ("DELETE", "/maps", None, 204),
        ("POST", "/services/wheel_control/set_control_mode", {"control_mode": "remote"}, 200),
        ("POST", "/services/wheel_control/set_control_mode", {"mode": "remote"}, 200),
        ("POST", "/services/wheel_control/set_control_mode", {}, 400),
        ("POST", "/services/wheel_control/set_emergency_stop", {"enable": True}, 200),
        ("POST", "/services/wheel_control/set_emergency_stop", {"enable": 1}, 400),
        ("POST", "/services/jack_up", None, 200),
        ("POST", "/services/jack_down", {}, 200),
        ("GET", "/robot-params", None, 503),
        ("GET", "/robot-params/default", None, 503),
        ("POST", "/robot-params", {}, 503),
        ("GET", "/device/info", None, 503),
        ("GET", "/device/info/brief", None, 200),
        ("GET", "/device/boot_progress", None, 200),
        ("GET", "/healthz", None, 200),
        ("GET", "/docs", None, 200),
        ("GET", "/openapi.json", None, 200),
        ("GET", "/tracked_pose", None, 404),
        ("DELETE", "/chassis/moves/1", None, 405),
    ],
)
def test_every_path_answers_the_same_with_a_slash_and_without(
    gateway: Gateway, method: str, path: str, body: Any, status: int
) -> None:
    for url in (path, path.rstrip("/") + "/"):
        answer = gateway.http.request(method, url, json=body, follow_redirects=False)
        assert (url, answer.status_code) == (url, status)


def test_services_answer_an_empty_object_and_201_where_so_configured(gateway: Gateway) -> None:
    assert gateway.http.post("/services/jack_up").json() == {}
    assert gateway.bus.requests[-1].direction == "up"
    with running_gateway(Settings(service_status=201)) as other:
        assert other.http.post("/services/jack_down").status_code == 201


def test_an_unknown_url_is_a_page_for_people_and_json_for_who_wants_it(gateway: Gateway) -> None:
    page = gateway.http.get("/<b>no")
    assert page.headers["content-type"].startswith("text/html")
    assert "Page not found at /&lt;b&gt;no" in page.text
    assert gateway.http.get("/no", headers={"accept": "application/json"}).json() == {"detail": "Not Found"}


def test_the_root_is_a_page_for_browsers_and_an_index_for_programs(gateway: Gateway) -> None:
    assert gateway.http.get("/").json()["websocket"] == "/ws/v2/topics"
    page = gateway.http.get("/", headers={"accept": "text/html,*/*"}).text
    for name in ("page.js", "page.css"):
        assert f"/page/{name}" in page
        assert gateway.http.get(f"/page/{name}").status_code == 200
    assert gateway.http.get("/page/index.html").status_code == 404
    assert gateway.http.get("/page/..%2fapp.py").status_code == 404


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"null",
        b'{"target_ori": NaN}',
        b'{"target_ori": -Infinity}',
        b'{"target_ori": 1e999}',
        b'{"target_ori": 1, "target_ori": 2}',
        b'{"creator": "\xff"}',
        b'{"creator": "\\ud800", "target_ori": 1}',
        b'{"target_ori": ' + b"9" * 5000 + b"}",
        b'{"target_ori": 1, "properties": ' + b'{"a":' * 500 + b"1" + b"}" * 501,
        b"\xef\xbb\xbf{}",
        '{"target_ori": 1}'.encode("utf-16"),
        b'{"target_ori": 1} trailing',
        b"{target_ori: 1}",
    ],
)
def test_a_body_that_is_not_strict_json_is_400_with_a_text(gateway: Gateway, content: bytes) -> None:
    answer = gateway.http.post("/chassis/moves", content=content, headers=JSON)
    assert answer.status_code == 400
    assert len(answer.json()) == 1
    assert answer.json()[0].startswith("body: ")


def test_content_types(gateway: Gateway) -> None:
    def post(kind: str | None) -> int:
        headers = {} if kind is None else {"content-type": kind}
        return gateway.http.post("/chassis/moves", content=b'{"target_ori": 1}', headers=headers).status_code

    assert [post(kind) for kind in (None, "application/json; charset=utf-8", "APPLICATION/JSON")] == [201, 201, 201]
    assert [post(kind) for kind in ("text/plain", "application/x-www-form-urlencoded", "nonsense")] == [415] * 3


def test_a_body_that_is_too_large_is_413(gateway: Gateway) -> None:
    with running_gateway(Settings(max_body_bytes=1000, planning_state_timeout=0)) as small:
        answer = small.http.post("/chassis/moves", content=b" " * 1001, headers=JSON)
        assert (answer.status_code, answer.json()) == (413, {"detail": "The body is larger than 1000 bytes."})
        assert small.http.post("/chassis/moves", json=MOVE).status_code == 201


def test_a_large_body_is_read_whole(gateway: Gateway) -> None:
    properties = {"note": "x" * 400_000}
    answer = gateway.http.post("/chassis/moves", json={**MOVE, "properties": properties})
    assert answer.json()["properties"] == properties


def test_unknown_headers_and_odd_hosts_do_no_harm(gateway: Gateway) -> None:
    gateway.http.post("/maps", json=map_body())
    for host in ("[", "a b", "x" * 500, "robot.local:8090"):
        rows = gateway.http.get("/maps", headers={"host": host, "x-api-key": "whatever"}).json()
        assert rows[0]["url"].endswith("/maps/1")
    assert rows[0]["url"] == "http://robot.local:8090/maps/1"


def test_cors_echoes_the_origin_and_allows_credentials(gateway: Gateway) -> None:
    origin = {"origin": "http://shop.example"}
    answer = gateway.http.get("/chassis/moves", headers=origin)
    assert answer.headers["access-control-allow-origin"] == "http://shop.example"
    assert answer.headers["access-control-allow-credentials"] == "true"
    wanted = {"access-control-request-method": "PATCH", "access-control-request-headers": "secret,content-type"}
    preflight = gateway.http.options("/chassis/moves/current", headers=origin | wanted)
    assert preflight.status_code == 200
    assert "PATCH" in preflight.headers["access-control-allow-methods"]
    assert preflight.headers["access-control-allow-headers"] == "secret,content-type"
    assert gateway.http.options("/chassis/moves").status_code == 200


def test_head_is_get_without_a_body(gateway: Gateway) -> None:
    answer = gateway.http.head("/chassis/moves")
    assert (answer.status_code, answer.content) == (200, b"")


def test_the_secret_where_one_is_set() -> None:
    with running_gateway(Settings(secret="gehéim", planning_state_timeout=0)) as gateway:
        http = gateway.http
        secret = "gehéim".encode()
        assert http.get("/chassis/moves").status_code == 401
        assert http.get("/chassis/moves", headers={"secret": "wrong"}).json() == {
            "detail": "The header Secret is missing or wrong."
        }
        assert http.get("/healthz").status_code == 200
        for headers in ({b"secret": secret}, {b"authorization": b"Secret " + secret}):
            assert http.get("/chassis/moves", headers=headers).status_code == 200  # type: ignore[arg-type]
        with gateway.websocket("/ws/v2/topics?secret=geh%C3%A9im") as client:
            assert client.ask({"enable_topic": "/a"}) == {"enabled_topics": ["/a"]}


def test_openapi_never_speaks_of_422(gateway: Gateway) -> None:
    document = gateway.http.get("/openapi.json").json()
    for operations in document["paths"].values():
        for operation in operations.values():
            assert "422" not in operation["responses"]
    assert "MoveBody" in document["components"]["schemas"]
    assert "HTTPValidationError" not in document["components"]["schemas"]
