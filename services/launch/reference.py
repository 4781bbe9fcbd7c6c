"""Reference tables, generated from the contract: topics, queries, WebSocket topics, reasons why moves fail."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from rackhand.schemas import crf_requests as crf
from rackhand.schemas import topics
from rackhand.schemas.api_coverage import ENDPOINTS
from rackhand.schemas.api_coverage import TOPICS as DOCUMENTED
from rackhand.schemas.base import Message
from rackhand.schemas.fail_causes import CAUSES
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.faults import FAULTS
from rackhand.schemas.motion import RefusalDetail
from rackhand.schemas.parameters import SETTINGS
from rackhand.schemas.racks import RackSpec
from rackhand.services.launch import access_control, asyncapi
from rackhand.worlds.scenario_model import Scenario, installed_scenarios, read_scenario

Table = tuple[tuple[str, ...], list[tuple[str, ...]]]


def topic_table() -> Table:
    """Header and rows of all published topics."""
    header: tuple[str, ...] = ("key", "message", "published by", "read by", "rate", "QoS", "WebSocket", "what")
    rows: list[tuple[str, ...]] = [
        (
            _shown(topic.key),
            _type(topic.model),
            topic.publisher,
            ", ".join(topic.readers) or "–",
            f"{topic.rate:g} Hz" if topic.rate else "on change",
            topic.qos.value,
            ", ".join(f"`{view.TOPIC}`" for view in topic.ws) or "–",
            topic.text,
        )
        for topic in topics.TOPICS
    ]
    return header, rows


def query_table() -> Table:
    """Header and rows of all queries."""
    header: tuple[str, ...] = ("key", "request", "reply", "answered by", "asked by", "what")
    rows: list[tuple[str, ...]] = [
        (_shown(q.key), _type(q.request), _type(q.reply), q.server, ", ".join(q.callers), q.text)
        for q in topics.QUERIES
    ]
    return header, rows


def websocket_table() -> Table:
    """Header and rows of the gateway's chassis WebSocket."""
    header: tuple[str, ...] = ("topic", "what", "at most", "on `/ws/topics`")
    return header, [
        (f"`{view.TOPIC}`", view.__doc__ or "", f"{view.RATE:g} Hz", f"`{view.LEGACY}`" if view.LEGACY else "the same")
        for view in topics.websocket_topics()
    ]


def fail_reason_table() -> Table:
    """Header and rows of all ``MoveFailReason`` values."""
    header: tuple[str, ...] = ("code", "`fail_reason_str` of REST", "name")
    rows: list[tuple[str, ...]] = [
        (str(int(reason)), f"`{reason.rest_string}`", reason.doc_name) for reason in MoveFailReason
    ]
    return header, rows


def fail_matrix() -> Table:
    """Header and rows of the reasons that a move can meet: cause, scenarios, and how each shows."""
    scenarios = _scenarios_by_reason()
    explained = {reason: [_explained(scenario) for scenario in found] for reason, found in scenarios.items()}
    header: tuple[str, ...] = (
        "code",
        "name",
        "cause",
        "scenarios",
        "what `explain` names",
        "`fail_reason_str` of `/planning_state`",
        "of REST",
    )
    rows: list[tuple[str, ...]] = [
        (
            str(int(reason)),
            reason.doc_name,
            CAUSES[reason].text,
            ", ".join(_link(scenario) for scenario in scenarios[reason]) or "–",
            "; ".join(dict.fromkeys(explained[reason])) or "–",
            f"`{reason.topic_string}`",
            f"`{reason.rest_string}`",
        )
        for reason in MoveFailReason
        if CAUSES[reason].met == "move"
    ]
    return header, rows


def _link(scenario: Scenario) -> str:
    link = f"[{scenario.name}](../worlds/{scenario.world}/scenarios/{scenario.name}.yaml)"
    return f"{link} (slow)" if scenario.slow else link


def other_fail_reasons() -> Table:
    """Header and rows of the reasons that no scenario provokes, most of which no move of this chassis meets."""
    header: tuple[str, ...] = ("code", "name", "why")
    rows: list[tuple[str, ...]] = [
        (str(int(reason)), reason.doc_name, f"needs {cause.text}" if cause.met == "device" else cause.text)
        for reason, cause in CAUSES.items()
        if cause.met != "move" and reason is not MoveFailReason.NONE
    ]
    return header, rows


def _scenarios_by_reason() -> dict[MoveFailReason, list[Scenario]]:
    """Reason → the scenarios that provoke it."""
    found: dict[MoveFailReason, list[Scenario]] = {reason: [] for reason in MoveFailReason}
    for path in installed_scenarios().values():
        scenario = read_scenario(path)
        found[scenario.expect.reason].append(scenario)
    return found


def _explained(scenario: Scenario) -> str:
    """What ``explain`` must name in that scenario."""
    named = scenario.expect.explain
    if named is None:
        return ""
    things = [f"{'' if one.role == 'blocks' else f'{one.role}: '}{one.kind}" for one in named.things]
    return ", ".join([*dict.fromkeys(things), *(f"“{words}”" for words in named.words), *named.measures])


def fault_table() -> Table:
    """Header and rows of the faults that the simulator can cause."""
    header: tuple[str, ...] = ("fault", "of a", "what", "options")
    rows: list[tuple[str, ...]] = [
        (f"`{kind.name}`", kind.target, kind.text, ", ".join(f"`{option}`" for option in kind.options) or "–")
        for kind in FAULTS.values()
    ]
    return header, rows


def settings_table() -> Table:
    """Header and rows of ``/system/settings``."""
    header: tuple[str, ...] = ("setting", "type", "what")
    return header, [
        (f"`{row.name}`", ", ".join(f"`{option}`" for option in row.options) or row.type, row.description)
        for row in SETTINGS
    ]


def robot_param_table() -> Table:
    """Header and rows of ``/robot-params``."""
    header: tuple[str, ...] = ("key", "setting", "what")
    return header, [(f"`{row.old_key}`", f"`{row.name}`", row.description) for row in SETTINGS if row.old_key]


def rack_spec_table() -> Table:
    """Header and rows of the fields of one kind of rack in ``rack.specs``."""
    header: tuple[str, ...] = ("field", "default", "what")
    return header, [
        (f"`{name}`", "required" if field.is_required() else f"`{json.dumps(field.default)}`", field.description or "")
        for name, field in RackSpec.model_fields.items()
    ]


def crf_request_table() -> Table:
    """Header and rows of the requests of CRF clients."""
    header: tuple[str, ...] = ("command", "fields", "answer", "what")
    return header, [
        (
            " or ".join(f"`{word}`" for word in crf.words(model)),
            ", ".join(_fields(model)) or "–",
            _answer(model),
            " ".join((model.__doc__ or "").split()).replace("``", "`"),
        )
        for model in crf.REQUESTS
    ]


def _fields(model: type[crf.Request]) -> list[str]:
    """What it has beside what every request may carry; what may be left out in brackets."""
    own = {name: field for name, field in model.model_fields.items() if name not in crf.Request.model_fields}
    fixed = [(f.alias or name, f) for name, f in own.items() if name not in _TOKEN]
    return [f"`{_spelled(name, field)}`" if field.is_required() else f"[`{name}`]" for name, field in fixed]


_TOKEN = ("lease_id", "epoch", "takeover")  # of every request that needs control


def _spelled(name: str, field: FieldInfo) -> str:
    """With its value, where it has one only."""
    values = get_args(field.annotation)
    return f"{name}: {values[0]}" if get_origin(field.annotation) is Literal and len(values) == 1 else name


def _answer(model: type[crf.Request]) -> str:
    if issubclass(model, crf.GetStatus):
        return "the status"
    if issubclass(model, crf.GetConfiguration):
        return "the configuration"
    if issubclass(model, crf.LockControl | crf.UnlockControl):
        return "`true` or `false`"
    return "`expected`" if issubclass(model, crf.ControlRequest | crf.SoftStop | crf.HardStop) else "`true`"


def refusal_table() -> Table:
    """Header and rows of the ``detail`` of refusals."""
    header: tuple[str, ...] = ("detail", "name")
    return header, [(str(int(detail)), detail.name.lower().replace("_", " ")) for detail in RefusalDetail]


def markdown(table: Table) -> str:
    header, rows = table
    return "\n".join(
        "| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |"
        for row in (header, tuple("---" for _ in header), *rows)
    )


def plain(table: Table) -> str:
    """Columns as wide as their widest cell."""
    header, rows = table
    lines = [tuple(cell.replace("`", "") for cell in row) for row in (header, *rows)]
    widths = [max(len(row[column]) for row in lines) for column in range(len(header))]
    return "\n".join("  ".join(f"{c:<{w}}" for c, w in zip(row, widths, strict=True)).rstrip() for row in lines)


def endpoint_table() -> Table:
    """Every endpoint of the chassis API."""
    header: tuple[str, ...] = ("endpoint", "here", "note")
    return header, [
        (f"`{row.method} {row.path}`", "works" if row.works else f"not available: {row.status}", row.text)
        for row in ENDPOINTS
    ]


def documented_topic_table() -> Table:
    """Every WebSocket topic of the chassis API."""
    header: tuple[str, ...] = ("topic", "direction", "here")
    return header, [
        (f"`{row.name}`", row.direction, "works" if row.works else f"silent: {row.missing}") for row in DOCUMENTED
    ]


BLOCKS: dict[str, Callable[[], Table]] = {
    "topics": topic_table,
    "queries": query_table,
    "websocket": websocket_table,
    "fail-reasons": fail_reason_table,
    "fail-matrix": fail_matrix,
    "fail-reasons-not-met": other_fail_reasons,
    "faults": fault_table,
    "settings": settings_table,
    "robot-params": robot_param_table,
    "rack-spec": rack_spec_table,
    "api-endpoints": endpoint_table,
    "api-topics": documented_topic_table,
    "crf-requests": crf_request_table,
    "crf-refusals": refusal_table,
}
_INCLUDE = re.compile(r"(<!-- include: (?P<path>\S+) -->\n```[a-z]*\n).*?(```\n)", re.DOTALL)
_BLOCK = re.compile(r"(<!-- generated: (?P<name>[a-z-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def refresh(text: str) -> str:
    """A Markdown page with its generated blocks and included files renewed.

    Raises ``KeyError`` for a block of an unknown name and ``OSError`` for a file that is not there; paths are relative
    to the working directory, which is that of ``make docs``.
    """
    text = _INCLUDE.sub(lambda block: f"{block[1]}{Path(block['path']).read_text(encoding='utf-8')}{block[3]}", text)
    return _BLOCK.sub(lambda block: f"{block[1]}{markdown(BLOCKS[block['name']]())}\n{block[3]}", text)


def _shown(key: str) -> str:
    return f"`{key.replace('{robot}', '<robot>')}`"


def _type(model: type[Message]) -> str:
    return f"`{model.__module__.removeprefix('rackhand.schemas.')}.{model.__name__}`"


def files() -> dict[str, Callable[[], str]]:
    """Whole files that are generated, by their names in the folder of pages."""
    return {"asyncapi.json": asyncapi.text, "access.json5": access_control.text}


def main() -> None:
    """``python -m rackhand.services.launch.reference FILE…`` renews the generated blocks of Markdown pages in place.

    A file of a name in ``files`` is renewed as a whole.
    """
    for name in sys.argv[1:]:
        page = Path(name)
        old = page.read_text(encoding="utf-8") if page.exists() else ""
        make = files().get(page.name)
        if (new := make() if make is not None else refresh(old)) != old:
            page.write_text(new, encoding="utf-8")
            print(f"renewed {name}")


if __name__ == "__main__":
    main()
