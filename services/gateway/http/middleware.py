"""What happens to a request before a route gets it: slashes, secret, body."""

from __future__ import annotations

import hmac
from collections.abc import Callable, Collection, Sequence
from urllib.parse import parse_qs

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers
from starlette.responses import Response
from starlette.routing import BaseRoute, Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from rackhand.services.gateway.http.bodies import MalformedJson, quote_bare_keys, read_json
from rackhand.services.gateway.http.errors import bad_request, detail, not_allowed
from rackhand.services.gateway.http.forms import MalformedForm, form_to_json

BODY_METHODS = frozenset({"POST", "PUT", "PATCH", "DELETE"})
# Asked by supervisors, which hold no secret, and by browsers, which cannot send it before the page is there.
OPEN_PATHS = frozenset({"/healthz", "/device/boot_progress", "/", "/docs", "/openapi.json"})
OPEN_FOLDERS = ("/page/", "/docs/")
# Here the API's documentation itself writes {state: "cancelled"}.
BARE_KEYS_PATH = "/chassis/moves/"
MOTION_FOLDER = "/motion/"
FORMS_FOLDER = "/maps"
LARGE_BODY = 256 * 1024


class TrailingSlash:
    """``/maps/`` is ``/maps``, everywhere and without a redirect, which would lose the body of a POST."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        path = scope.get("path", "")
        if len(path) > 1 and path.endswith("/"):
            scope = {**scope, "path": path.rstrip("/") or "/"}
        await self.app(scope, receive, send)


class AnyMethod:
    """HEAD is GET without a body (which the server leaves out by itself), and OPTIONS is always answered."""

    def __init__(self, app: ASGIApp, allowed: Callable[[str], str]) -> None:
        self.app = app
        self.allowed = allowed

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        method = scope.get("method")
        if method == "OPTIONS":
            await Response(headers={"allow": self.allowed(scope["path"])})(scope, receive, send)
            return
        await self.app({**scope, "method": "GET"} if method == "HEAD" else scope, receive, send)


class SecretHeader:
    """Wants ``Secret: …`` or ``Authorization: Secret …``.

    A WebSocket, to which browsers give no headers of their own, may bring it as ``?secret=…``.
    """

    def __init__(self, app: ASGIApp, secret: str) -> None:
        self.app = app
        self.secret = secret.encode()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if not self.secret or scope["type"] not in ("http", "websocket") or self._may_pass(scope):
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": "the secret is wrong"})
        else:
            await detail(401, "The header Secret is missing or wrong.")(scope, receive, send)

    def _may_pass(self, scope: Scope) -> bool:
        path = scope["path"]
        if path in OPEN_PATHS or path.startswith(OPEN_FOLDERS) or scope.get("method") == "OPTIONS":
            return True
        headers = Headers(scope=scope)
        texts = (headers.get("secret", ""), headers.get("authorization", "").removeprefix("Secret "))
        given = [text.encode("latin-1") for text in texts]  # as headers are decoded
        if scope["type"] == "websocket":
            given += [text.encode() for text in parse_qs(scope["query_string"].decode("latin-1")).get("secret", [])]
        return any(hmac.compare_digest(one, self.secret) for one in given)


class StrictBody:
    """Lets only well-formed JSON through. A body without a Content-Type counts as JSON; an empty one is none.

    The URL is checked first, then the method, the content type, and the body: what none of ``routes`` takes goes on
    unread, to be answered with 404 or 405. ``find`` gives a path's parameters, of which ids are numbers, and its
    ``Allow`` header. Maps may also come as a form; its fields in ``numbers`` are numbers.
    """

    def __init__(
        self,
        app: ASGIApp,
        routes: Sequence[BaseRoute],
        find: Callable[[str], tuple[dict[str, str], str] | None],
        max_bytes: int,
        numbers: Collection[str] = (),
    ) -> None:
        self.app = app
        self.routes = routes
        self.find = find
        self.max_bytes = max_bytes
        self.numbers = frozenset(numbers)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or scope["method"] not in BODY_METHODS:
            await self.app(scope, receive, send)
            return
        refusal = self._check_url(scope["path"], scope["method"])
        if refusal is not None:
            await refusal(scope, receive, send)
            return
        if not any(route.matches(scope)[0] is Match.FULL for route in self.routes):
            await self.app(scope, receive, send)
            return
        body = await self._read(receive)
        if body is None:  # the client is gone
            return
        checked = await self._check(scope, body)
        if isinstance(checked, Response):
            await checked(scope, receive, send)
        else:
            await self.app(_as_json(scope, checked), _replay(checked, receive), send)

    def _check_url(self, path: str, method: str) -> Response | None:
        """404 for an id that is no number, 405 for a method that the path does not take."""
        found = self.find(path)
        if found is None:
            return None
        parameters, allowed = found
        if any(name.endswith("_id") and not value.lstrip("-").isdecimal() for name, value in parameters.items()):
            return detail(404, "Not found.")
        return None if method in allowed.split(", ") else not_allowed(method, allowed)

    async def _read(self, receive: Receive) -> bytes | None:
        """The body; of one that is too large, only as much as shows that it is."""
        chunks, size = [], 0
        while size <= self.max_bytes:
            message = await receive()
            if message["type"] == "http.disconnect":
                return None
            chunks.append(message.get("body", b""))
            size += len(chunks[-1])
            if not message.get("more_body", False):
                break
        return b"".join(chunks)

    async def _check(self, scope: Scope, body: bytes) -> bytes | Response:
        if len(body) > self.max_bytes:
            return detail(413, f"The body is larger than {self.max_bytes} bytes.", {"connection": "close"})
        if not body:
            return body
        kind = Headers(scope=scope).get("content-type", "application/json")
        media = kind.partition(";")[0].strip().lower()
        if media == "multipart/form-data" and scope["path"].partition(FORMS_FOLDER)[0] == "":
            try:
                return await run_in_threadpool(form_to_json, body, kind, self.numbers)
            except MalformedForm as error:
                return bad_request([f"form: {error}"])
        if not (media == "application/json" or (media.startswith("application/") and media.endswith("+json"))):
            return detail(415, f"Content-Type is {media[:60]!r}, want application/json")
        if scope["path"].startswith(MOTION_FOLDER):  # the protocol has its own answer to what is malformed
            return body
        if scope["method"] == "PATCH" and scope["path"].startswith(BARE_KEYS_PATH):
            body = quote_bare_keys(body)
        try:
            if len(body) < LARGE_BODY:
                read_json(body)
            else:
                await run_in_threadpool(read_json, body)
        except MalformedJson as error:
            return bad_request([f"body: {error}"])
        return body


def _as_json(scope: Scope, body: bytes) -> Scope:
    """The request as a route gets it: with a body of JSON, whatever its headers said of it."""
    dropped = (b"content-type", b"content-length", b"transfer-encoding")
    headers = [(name, value) for name, value in scope["headers"] if name not in dropped]
    if body:
        headers += [(b"content-type", b"application/json"), (b"content-length", str(len(body)).encode())]
    return {**scope, "headers": headers}


def _replay(body: bytes, receive: Receive) -> Receive:
    """The body once more, then whatever comes after it."""
    pending = [{"type": "http.request", "body": body, "more_body": False}]

    async def replayed() -> Message:
        return pending.pop() if pending else await receive()

    return replayed
