"""Refusals in the API's shapes: a list of texts for a malformed request, ``{"detail": …}`` for all else.

An unknown URL answers an HTML page, as a real robot does, unless the client asks for JSON.
"""

from __future__ import annotations

import html
from collections.abc import Callable, Sequence
from typing import Any

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import HTMLResponse, JSONResponse, Response
from pydantic import BaseModel
from starlette.exceptions import HTTPException

from rackhand.bus import BusError, CallTimeout, Refused, Unavailable
from rackhand.bus.log import get_logger
from rackhand.schemas.codec import MalformedMessage
from rackhand.schemas.refusal import RefusalCode

log = get_logger(__name__)

MAX_TEXTS = 10


class Detail(BaseModel):
    """Why a request was refused."""

    detail: str


class BadRequest(Exception):
    """The request is not well formed; each text says what, where, and what was expected."""

    def __init__(self, *texts: str) -> None:
        super().__init__("; ".join(texts))
        self.texts = texts


_DESCRIPTIONS: dict[int, tuple[str, Any]] = {
    400: ("Malformed (a list of texts), or a precondition is not met (`detail`)", list[str] | Detail),
    401: ("The `Secret` header is wrong; only where the gateway is configured with a secret", Detail),
    404: ("Not found", Detail),
    413: ("The body is larger than the gateway accepts", Detail),
    415: ("The Content-Type is not one this path accepts", Detail),
    503: ("The service that answers this is down or still starting", Detail),
}


def failures(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The ``responses`` of a route that may fail so; 401 goes with every route, 415 with every one that has a body."""
    with_body = (415,) if 413 in statuses else ()
    return {
        status: {"description": _DESCRIPTIONS[status][0], "model": _DESCRIPTIONS[status][1]}
        for status in (401, *statuses, *with_body)
    }


def bad_request(texts: Sequence[str]) -> JSONResponse:
    more = len(texts) - MAX_TEXTS
    return JSONResponse([*texts[:MAX_TEXTS], *([f"… and {more} more"] if more > 0 else [])], status_code=400)


def detail(status: int, text: str, headers: dict[str, str] | None = None) -> JSONResponse:
    return JSONResponse({"detail": text}, status_code=status, headers=headers)


def not_allowed(method: str, allowed: str) -> JSONResponse:
    return detail(405, f'Method "{method}" not allowed.', {"allow": allowed})


def from_bus(error: BusError | MalformedMessage) -> JSONResponse:
    """The HTTP answer to a refusal or a missing answer on the bus."""
    match error:
        case Refused(code=RefusalCode.NOT_FOUND):
            return detail(404, error.text)
        case Refused(code=RefusalCode.INVALID | RefusalCode.MALFORMED):
            return bad_request([error.text])
        case Refused(code=RefusalCode.PRECONDITION):
            return detail(400, error.text)
        case Refused(code=RefusalCode.UNAVAILABLE | RefusalCode.TIMEOUT):
            return detail(503, error.text)
        case Refused():
            log.error("a service answered with an internal error", code=error.code, text=error.text)
            return detail(500, error.text)
        case Unavailable() | CallTimeout():
            return detail(503, str(error))
        case _:
            log.error("invalid answer from a service", error=str(error))
            return detail(503, f"invalid answer from a service: {error}")


def install(app: FastAPI, allowed: Callable[[str], str]) -> None:
    """Every failure in its shape; none with a traceback in it. ``allowed`` gives a path's ``Allow`` header."""

    @app.exception_handler(BadRequest)
    async def malformed(_: Request, error: BadRequest) -> Response:
        return bad_request(error.texts)

    @app.exception_handler(RequestValidationError)
    async def invalid(_: Request, error: RequestValidationError) -> Response:
        return not_valid(error)

    @app.exception_handler(BusError)
    async def refused(_: Request, error: BusError) -> Response:
        return from_bus(error)

    @app.exception_handler(MalformedMessage)
    async def unreadable(_: Request, error: MalformedMessage) -> Response:
        return from_bus(error)

    @app.exception_handler(HTTPException)
    async def http(request: Request, error: HTTPException) -> Response:
        if error.status_code == 405:
            return not_allowed(request.method, allowed(request.scope["path"]))
        return http_error(request, error)

    @app.exception_handler(Exception)
    async def unexpected(request: Request, error: Exception) -> Response:
        log.error("unexpected error", path=request.scope["path"], error=repr(error))
        return detail(500, "internal error; see the gateway's log")


def not_valid(error: RequestValidationError) -> Response:
    """A path with a part that is not a number is not found; everything else is a malformed request."""
    found = error.errors()
    if any(one["loc"][:1] == ("path",) for one in found):
        return detail(404, "Not found.")
    return bad_request([_sentence(one) for one in found])


def _sentence(error: Any) -> str:
    where = ".".join(str(part) for part in error["loc"][1:]) or str(error["loc"][0])
    if error["type"] == "missing":
        return f"{where}: is missing"
    if error["type"] == "value_error":
        return f"{where}: {error['ctx']['error']}"
    return f"{where}: {error['msg']}, got {_short(error.get('input'))}"


def _short(value: Any) -> str:
    """The first 60 characters of a value, without writing out all of a large one."""
    if isinstance(value, dict | list):
        return f"{'an object' if isinstance(value, dict) else 'a list'} of {len(value)}"
    if isinstance(value, int) and not isinstance(value, bool) and abs(value) >= 2**64:
        return f"an integer of {value.bit_length()} bits"
    return f"{value[:60] if isinstance(value, str | bytes) else value!r}"


def http_error(request: Request, error: HTTPException) -> Response:
    if error.status_code == 404 and error.detail == "Not Found" and not _wants_json(request):
        return _page_not_found(request.scope["path"])
    return detail(error.status_code, str(error.detail), dict(error.headers or {}))


def _wants_json(request: Request) -> bool:
    return "application/json" in request.headers.get("accept", "")


def _page_not_found(path: str) -> HTMLResponse:
    title = f"Page not found at {html.escape(path[:200])}"
    return HTMLResponse(
        f"<!DOCTYPE html><html lang=en><head><title>{title}</title></head><body><h1>Page not found</h1>"
        f'<p>{title}. Documentation: <a href="/docs">/docs</a>.</p></body></html>\n',
        status_code=404,
    )


def not_found(text: str) -> HTTPException:
    return HTTPException(404, text)


def unavailable(text: str) -> HTTPException:
    """503: a message that this answer needs has not arrived yet."""
    return HTTPException(503, text)
