"""The page before Rerun's own web server."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import httpx
import pytest

from rackhand.services.viewer.page import Page, address_for, policy
from rackhand.testing.ports import free_port

DATA_PORT = 9876


class Assets(BaseHTTPRequestHandler):
    """Stands for Rerun's server."""

    def do_GET(self) -> None:
        found = self.path.startswith(("/?", "/re_viewer.js"))
        body = f"this is {self.path}".encode()
        self.send_response(200 if found else 404)
        self.send_header("Content-Type", "text/javascript")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None: ...


@pytest.fixture
def assets() -> Iterator[ThreadingHTTPServer]:
    server = ThreadingHTTPServer(("127.0.0.1", 0), Assets)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield server
    server.shutdown()
    server.server_close()


@pytest.fixture
def page(assets: ThreadingHTTPServer) -> Iterator[str]:
    port = free_port()
    with Page("127.0.0.1", port, ("127.0.0.1", assets.server_port), DATA_PORT):
        yield f"http://127.0.0.1:{port}"


def test_the_plain_address_opens_the_cell(page: str) -> None:
    answer = httpx.get(f"{page}/", trust_env=False, follow_redirects=True)
    assert answer.status_code == 200
    assert answer.url.params["url"] == f"rerun+http://127.0.0.1:{DATA_PORT}/proxy"


def test_a_browser_elsewhere_is_sent_to_the_machine_it_asked() -> None:
    assert address_for("/", "lab7", 9876) == "/?url=rerun%2Bhttp%3A%2F%2Flab7%3A9876%2Fproxy"
    assert address_for("/?url=rerun%2Bhttp%3A%2F%2Flab7%3A9876%2Fproxy", "lab7", 9876) is None
    assert address_for("/re_viewer.js", "lab7", 9876) is None


def test_what_the_page_is_made_of_passes_as_it_is(page: str) -> None:
    answer = httpx.get(f"{page}/re_viewer.js", trust_env=False)
    assert (answer.status_code, answer.text) == (200, "this is /re_viewer.js")
    assert answer.headers["content-type"] == "text/javascript"
    assert httpx.get(f"{page}/nothing", trust_env=False).status_code == 404


def test_the_page_may_talk_to_its_cell_only(page: str) -> None:
    answer = httpx.get(f"{page}/?url=x", trust_env=False)
    assert answer.headers["content-security-policy"] == policy("127.0.0.1", DATA_PORT)
    rules = dict(rule.strip().split(" ", 1) for rule in policy("lab7", 9876).split(";"))
    assert rules["connect-src"] == "'self' http://lab7:9876"
    assert rules["default-src"] == "'self'"


def test_a_dead_server_is_reported(page: str, assets: ThreadingHTTPServer) -> None:
    assets.shutdown()
    assets.server_close()
    assert httpx.get(f"{page}/re_viewer.js", trust_env=False).status_code == 502
