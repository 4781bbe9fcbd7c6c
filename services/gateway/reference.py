"""The reference page of all HTTP calls, generated from the OpenAPI document: ``python -m … FILE`` writes it."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, cast

from rackhand.services.gateway.context import BusClient
from rackhand.services.gateway.fleet import Fleet
from rackhand.services.gateway.http.app import create_app
from rackhand.services.gateway.presence import Services
from rackhand.services.gateway.settings import Settings

Json = Mapping[str, Any]

METHODS = ("get", "post", "put", "patch", "delete")
HEAD = """# Chassis calls in full

<!-- This page is generated from the OpenAPI document: `make docs`. -->

Every call of the gateway with its parameters, the fields of its body, and its answers. The OpenAPI document itself is
at `/openapi.json` of a running cell, and can be tried out at `/docs`. What the calls are for is on
[the chassis API](chassis-api.md), CRF commands to arms on [the arm protocol](motion.md).
"""
REFERENCE = "#/components/schemas/"


def page() -> str:
    """The whole page, in Markdown."""
    document = openapi()
    lines = [HEAD]
    for path, operations in document["paths"].items():
        for method in METHODS:
            if method in operations:
                lines += [f"## {method.upper()} {path}", "", *_operation(operations[method])]
    lines += ["# Objects", ""]
    for name, schema in document.get("components", {}).get("schemas", {}).items():
        lines += [f"## {name}", "", *_object(schema)]
    return "\n".join(lines).rstrip() + "\n"


def openapi() -> dict[str, Any]:
    """The document of a gateway without a bus, which is enough to describe it."""
    settings = Settings()
    fleet = Fleet(settings.robots, settings.interval, Services((), 0.0))
    return create_app(fleet, cast(BusClient, None), settings).openapi()


def _operation(operation: Json) -> Iterator[str]:
    if text := operation.get("description") or operation.get("summary"):
        yield from (_one_line(text), "")
    if parameters := operation.get("parameters"):
        yield from ("| parameter | in | type | what |", "| --- | --- | --- | --- |")
        for row in parameters:
            what = _one_line(row.get("description", ""))
            yield _row(f"`{row['name']}`", row["in"], _type(row.get("schema", {})), what)
        yield ""
    for kind, content in operation.get("requestBody", {}).get("content", {}).items():
        yield from (f"Body, `{kind}`: {_type(content.get('schema', {}))}", "")
    answers = [f"{code} {_answer(answer)}" for code, answer in operation["responses"].items()]
    yield from (f"Answers: {'; '.join(answers)}.", "")


def _answer(answer: Json) -> str:
    types = [_type(content["schema"]) for content in answer.get("content", {}).values() if content.get("schema")]
    text = _one_line(answer.get("description", "")).rstrip(".")
    return f"{text} ({', '.join(types)})" if types else text


def _object(schema: Json) -> Iterator[str]:
    if text := schema.get("description"):
        yield from (_one_line(text), "")
    if "enum" in schema:
        yield from (", ".join(f"`{json.dumps(value)}`" for value in schema["enum"]), "")
    if not (properties := schema.get("properties")):
        return
    required = schema.get("required", ())
    yield from ("| field | type | default | what |", "| --- | --- | --- | --- |")
    for name, field in properties.items():
        default = f"`{json.dumps(field['default'], ensure_ascii=False)}`" if "default" in field else ""
        needed = "required" if name in required else default
        yield _row(f"`{name}`", _type(field), needed, _one_line(field.get("description", "")))
    yield ""


def _type(schema: Json) -> str:
    """In words, with a link to the object where it is one."""
    if reference := schema.get("$ref"):
        name = reference.removeprefix(REFERENCE)
        return f"[{name}](#{name.lower()})"
    for several in ("anyOf", "oneOf", "allOf"):
        if several in schema:
            return " or ".join(dict.fromkeys(_type(part) for part in schema[several]))
    if "const" in schema:
        return f"`{json.dumps(schema['const'], ensure_ascii=False)}`"
    if "enum" in schema:
        return ", ".join(f"`{json.dumps(value, ensure_ascii=False)}`" for value in schema["enum"])
    if schema.get("type") == "array":
        return f"list of {_type(schema.get('items', {}))}"
    return str(schema.get("type", "any JSON"))


def _row(*cells: str) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _one_line(text: str) -> str:
    """Without reStructuredText's double backquotes; angle brackets are no tags."""
    return re.sub(r"\s+", " ", text.replace("``", "`")).strip()


def main() -> None:
    """Writes the page into the file named on the command line, if it differs."""
    file = Path(sys.argv[1])
    if not file.exists() or file.read_text(encoding="utf-8") != page():
        file.write_text(page(), encoding="utf-8")
        print(f"renewed {file}")


if __name__ == "__main__":
    main()
