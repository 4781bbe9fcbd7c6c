"""``/docs``: the API to read and try out, by Swagger UI. Its files come with a package, none from the net."""

from __future__ import annotations

import base64
import hashlib
import re
from importlib.resources import files

from fastapi import APIRouter, Request
from fastapi.openapi.docs import get_swagger_ui_html
from fastapi.responses import Response

from rackhand.services.gateway.http.errors import not_found
from rackhand.services.gateway.http.pages import asset, page

router = APIRouter(include_in_schema=False)

_FOLDER = files("fastapi_swagger") / "resources"
ASSETS = frozenset({"swagger-ui-bundle.js", "swagger-ui.css", "favicon-32x32.png"})
_INLINE_SCRIPT = re.compile(r"<script>(.*?)</script>", re.DOTALL)


@router.get("/docs")
def docs(request: Request) -> Response:
    html = get_swagger_ui_html(
        openapi_url="/openapi.json",
        title=request.app.title,
        swagger_js_url="/docs/swagger-ui-bundle.js",
        swagger_css_url="/docs/swagger-ui.css",
        swagger_favicon_url="/docs/favicon-32x32.png",
        swagger_ui_parameters={"validatorUrl": None, "displayRequestDuration": True},
    )
    text = bytes(html.body).decode()
    return page(text, " ".join(_source(script) for script in _INLINE_SCRIPT.findall(text)))


@router.get("/docs/{name}")
def docs_asset(name: str) -> Response:
    if name not in ASSETS:
        raise not_found("Not Found")
    return asset(_FOLDER / name)


def _source(script: str) -> str:
    """An inline script as a content policy names it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"
