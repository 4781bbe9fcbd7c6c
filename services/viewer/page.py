"""The page: Rerun's web viewer, opened on this cell, and kept to this cell.

It replaces the page of Rerun's own web server, which needs the recording in its address and connects to the internet
for news, examples, a web font and usage statistics. Here the plain address is enough, and a content security policy
lets the page connect to the cell only.
"""

from __future__ import annotations

import http.client
import shutil
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from types import TracebackType
from urllib.parse import parse_qs, quote, urlsplit

PATIENCE = 10.0
_PASSED_ON = ("Content-Type", "Content-Length", "Content-Encoding", "rerun-final-length")


class Page:
    """Serves on ``host:port`` what Rerun's server has at ``127.0.0.1:assets``. Use as a context manager."""

    def __init__(self, host: str, port: int, assets: tuple[str, int], data_port: int) -> None:
        self._server = ThreadingHTTPServer((host, port), _handler(assets, data_port))
        self._server.daemon_threads = True

    def __enter__(self) -> Page:
        threading.Thread(target=self._server.serve_forever, name="page", daemon=True).start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._server.shutdown()
        self._server.server_close()


def stream_url(host: str, data_port: int) -> str:
    """What a viewer on ``host``'s side of the network opens."""
    return f"rerun+http://{host}:{data_port}/proxy"


def address_for(path: str, host: str, data_port: int) -> str | None:
    """Where a browser that asked ``host`` for ``path`` is sent instead; None if it is right there."""
    parts = urlsplit(path)
    if parts.path not in ("/", "/index.html") or "url" in parse_qs(parts.query):
        return None
    return f"/?url={quote(stream_url(host, data_port), safe='')}"


def policy(host: str, data_port: int) -> str:
    """Whom the page may talk to: where it comes from, and where the recordings are."""
    return (
        "default-src 'self'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        f"img-src 'self' data: blob:; worker-src 'self' blob:; connect-src 'self' http://{host}:{data_port}"
    )


def _handler(assets: tuple[str, int], data_port: int) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            host = urlsplit(f"//{self.headers.get('Host', '')}").hostname or "127.0.0.1"
            elsewhere = address_for(self.path, host, data_port)
            if elsewhere is not None:
                self.send_response(302)
                self.send_header("Location", elsewhere)
                self.send_header("Content-Length", "0")
                self.end_headers()
                return
            upstream = http.client.HTTPConnection(*assets, timeout=PATIENCE)
            try:
                upstream.request("GET", self.path)
                answer = upstream.getresponse()
            except OSError:
                self.send_error(502, "Rerun's server does not answer")
                return
            self._pass_on(answer, host)
            upstream.close()

        def _pass_on(self, answer: http.client.HTTPResponse, host: str) -> None:
            self.send_response(answer.status)
            for name in _PASSED_ON:
                if (value := answer.getheader(name)) is not None:
                    self.send_header(name, value)
            self.send_header("Content-Security-Policy", policy(host, data_port))
            self.end_headers()
            shutil.copyfileobj(answer, self.wfile)

        def log_message(self, format: str, *args: object) -> None:
            """Nobody wants to read of every request."""

    return Handler
