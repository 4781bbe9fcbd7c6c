"""The methods of a path, for the ``Allow`` header of an OPTIONS answer and of status 405, and its parameters."""

from __future__ import annotations

from typing import Any

from starlette.routing import compile_path


class AllowedMethods:
    """Reads them from the OpenAPI document; a path that is not in it takes GET."""

    def __init__(self, document: dict[str, Any]) -> None:
        # A path without parameters goes before one that would match it too.
        paths = sorted(document["paths"].items(), key=lambda item: "{" in item[0])
        self._table = [(compile_path(path)[0], _header(operations)) for path, operations in paths]

    def find(self, path: str) -> tuple[dict[str, str], str] | None:
        """The parameters in a path, by name, and its ``Allow`` header; None for a path that is not in the document."""
        matches = ((regex.match(path), allowed) for regex, allowed in self._table)
        return next(((match.groupdict(), allowed) for match, allowed in matches if match), None)

    def header(self, path: str) -> str:
        found = self.find(path)
        return found[1] if found is not None else _header(("get",))


def _header(operations: Any) -> str:
    methods = {method.upper() for method in operations} | {"OPTIONS"}
    return ", ".join(sorted(methods | ({"HEAD"} if "GET" in methods else set())))
