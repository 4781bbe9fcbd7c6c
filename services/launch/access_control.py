"""Zenoh's access control for a cell: which service may publish, subscribe, answer and ask what.

Generated from ``schemas/topics.py``. Everything that no rule allows is denied. Fields and message names:
https://zenoh.io/docs/manual/access-control/
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from typing import Any

from rackhand.schemas import topics
from rackhand.schemas.service import ALIVE_EVERYWHERE
from rackhand.schemas.topics import Qos, Query, Role, Topic, published_by, read_by

Json = dict[str, Any]

# The roles of each process. The names are what its certificate or its user is called.
PROCESSES: dict[str, tuple[Role, ...]] = {
    "driver": ("driver",),
    "localiser": ("localiser",),
    "planner": ("planner",),
    "controller": ("controller",),
    "sim": ("sim", "driver", "localiser"),
    "gateway": ("gateway",),
    "viewer": ("viewer",),
    "recorder": ("viewer",),
    "node": ("node",),
}
_HEADER = """\
// Access control of a cell, for the router's Zenoh configuration. Generated from schemas/topics.py by `make docs`.
// A process is known by the common name of its certificate (mutual TLS) or by its user name. Services must connect to
// the router as clients: peers that reach each other directly are not checked by it.
// `*` matches every robot; replace it by a name to restrict a service to one robot.
"""


def text() -> str:
    """The ``access_control`` section as JSON5, as it is committed."""
    return _HEADER + json.dumps({"access_control": section()}, indent=2) + "\n"


def section() -> Json:
    """The section as data."""
    rules: dict[str, list[Json]] = {name: _rules(name, roles) for name, roles in PROCESSES.items()}
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for found in rules.values() for rule in found],
        "subjects": [
            subject
            for name in PROCESSES
            for subject in (
                {"id": f"{name} by certificate", "cert_common_names": [name]},
                {"id": f"{name} by user", "usernames": [name]},
            )
        ],
        "policies": [
            {"rules": [rule["id"] for rule in found], "subjects": [f"{name} by certificate", f"{name} by user"]}
            for name, found in rules.items()
        ],
    }


def _rules(name: str, roles: Sequence[Role]) -> list[Json]:
    """``in`` is what the process may send, ``out`` what may be sent to it."""
    is_node = "node" in roles
    published = () if is_node else (*published_by(*roles), topics.BUS_STATS)
    read = topics.TOPICS if is_node else read_by(*roles)
    served = [query for query in topics.QUERIES if query.server in roles]
    asked = [query for query in topics.QUERIES if set(query.callers) & set(roles)]
    tokens = [] if is_node else [f"rackhand/*/alive/{known}" for known in dict.fromkeys((name, *roles))]
    caches = [*_history(published), *_latched(published)]
    rules = [
        _rule(name, "publish", "in", ["put", "delete"], _keys(published)),
        _rule(name, "publish", "out", ["declare_subscriber"], _keys(published)),
        _rule(name, "subscribe", "in", ["declare_subscriber"], _keys(read)),
        _rule(name, "subscribe", "out", ["put", "delete"], _keys(read)),
        _rule(name, "answer", "in", ["declare_queryable", "reply"], [*_keys(served), *caches]),
        _rule(name, "answer", "out", ["query"], [*_keys(served), *_history(published)]),
        _rule(name, "ask", "in", ["query"], [*_keys(asked), *_history(read)]),
        _rule(name, "ask", "out", ["declare_queryable", "reply"], [*_keys(asked), *_history(read), *_latched(read)]),
        _rule(name, "announce", "in", ["liveliness_token"], [*tokens, *_history(published)]),
        _rule(name, "watch", "in", ["declare_liveliness_subscriber", "liveliness_query"],
              [ALIVE_EVERYWHERE, *_history(read)]),
        _rule(name, "watch", "out", ["liveliness_token"], [ALIVE_EVERYWHERE, *_history(read)]),
    ]  # fmt: skip
    return [rule for rule in rules if rule["key_exprs"]]


def _rule(process: str, what: str, direction: str, messages: list[str], keys: list[str]) -> Json:
    return {
        "id": f"{process} {what} {direction}",
        "permission": "allow",
        "flows": ["ingress" if direction == "in" else "egress"],
        "messages": messages,
        "key_exprs": keys,
    }


def _keys(rows: Iterable[Topic[Any] | Query[Any, Any]]) -> list[str]:
    return [row.key_for("*") for row in rows]


def _latched(rows: Iterable[Topic[Any]]) -> list[str]:
    """The keys of latched samples, which are replies when a late subscriber asks for the last one."""
    return [row.key_for("*") for row in rows if row.qos is Qos.LATCHED]


def _history(rows: Iterable[Topic[Any]]) -> list[str]:
    """Where latched topics are found by late subscribers: the keys of Zenoh's advanced publishers."""
    return [f"{row.key_for('*')}/@adv/**" for row in rows if row.qos is Qos.LATCHED]
