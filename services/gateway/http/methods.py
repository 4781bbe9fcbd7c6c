"""Which methods a path takes: the ``Allow`` header of an OPTIONS answer and of status 405."""

from __future__ import annotations

from typing import Any

from starlette.routing import compile_path


class AllowedMethods:
    """Reads them from the OpenAPI document; a path that is not in it is one to look at."""

    def __init__(self, document: dict[str, Any]) -> None:
        # A path without parameters goes before one that would match it too.
        paths = sorted(document["paths"].items(), key=lambda item: "{" in item[0])
        self._table = [(compile_path(path)[0], _header(operations)) for path, operations in paths]

    def header(self, path: str) -> str:
        return next((allowed for regex, allowed in self._table if regex.match(path)), _header(("get",)))


def _header(operations: Any) -> str:
    methods = {method.upper() for method in operations} | {"OPTIONS"}
    return ", ".join(sorted(methods | ({"HEAD"} if "GET" in methods else set())))
