"""``/static-files``: the images that ``data_url`` of WebSocket frames names."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Header
from fastapi.responses import Response

from rackhand.services.gateway.context import Gateway
from rackhand.services.gateway.http.errors import failures, not_found
from rackhand.services.gateway.ws.files import FOLDER

router = APIRouter(tags=["maps"])

_PNG: dict[int | str, dict[str, Any]] = {
    200: {"content": {"image/png": {"schema": {"type": "string", "format": "binary"}}}},
    304: {"description": "The file the client has, named by `If-None-Match`, is the present one"},
}


@router.get(f"/{FOLDER}/{{name}}", response_class=Response, responses={**_PNG, **failures(404)})
async def static_file(name: str, gateway: Gateway, if_none_match: Annotated[str | None, Header()] = None) -> Response:
    """A map or costmap as PNG. Its name is made of its content, so it may be cached."""
    png = gateway.state.facts.files.get(name)
    if png is None:
        raise not_found(f"there is no file {name[:100]!r}; frames of /map_v2 and /map/costmap_v2 name the present ones")
    tag = f'"{name}"'
    headers = {"etag": tag, "cache-control": "public, max-age=2592000"}
    tags = {one.strip().removeprefix("W/") for one in (if_none_match or "").split(",")}
    if tags & {tag, "*"}:
        return Response(status_code=304, headers=headers)
    return Response(png, media_type="image/png", headers=headers)
