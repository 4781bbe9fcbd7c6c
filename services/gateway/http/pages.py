"""What browsers are given: pages that load nothing from elsewhere, and their files."""

from __future__ import annotations

from importlib.resources.abc import Traversable
from pathlib import PurePath

from fastapi.responses import HTMLResponse, Response

# Browsers keep to it even where a script of ours, or of others, would not.
CONTENT_POLICY = "default-src 'self'; img-src 'self' data:; style-src 'self' 'unsafe-inline'"
_MEDIA_TYPES = {
    ".js": "text/javascript; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".png": "image/png",
}
_FRESH = {"cache-control": "no-cache"}  # a new release shows at once


def page(html: str, inline_script: str = "") -> Response:
    """An HTML page. ``inline_script`` is the policy's source of the one script it may hold, as in ``'sha256-…'``."""
    policy = f"{CONTENT_POLICY}; script-src 'self' {inline_script}".rstrip()
    return HTMLResponse(html, headers={"content-security-policy": policy, **_FRESH})


def asset(file: Traversable) -> Response:
    """A file that a page loads."""
    return Response(file.read_bytes(), media_type=_MEDIA_TYPES[PurePath(file.name).suffix], headers=_FRESH)
