"""The access-control lists: what each service may do follows from the table, and Zenoh enforces it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from rackhand.bus import Bus, BusConfig, CallTimeout, Unavailable
from rackhand.schemas import topics
from rackhand.schemas.service import ServiceId
from rackhand.schemas.topics import QUERIES, TOPICS
from rackhand.services.launch.access_control import PROCESSES, section
from rackhand.testing.ports import free_port
from tests.gateway import messages

SECTION = section()


def keys(process: str, message: str, flow: str = "ingress") -> set[str]:
    """The keys on which a process may send (``ingress``) or get (``egress``) a kind of message."""
    policies = [policy for policy in SECTION["policies"] if f"{process} by user" in policy["subjects"]]
    allowed = {rule for policy in policies for rule in policy["rules"]}
    rules = [rule for rule in SECTION["rules"] if rule["id"] in allowed and flow in rule["flows"]]
    return {key for rule in rules if message in rule["messages"] for key in rule["key_exprs"]}


def test_each_topic_has_its_one_publisher_and_the_simulator_those_of_the_drivers() -> None:
    for topic in TOPICS:
        if topic is not topics.BUS_STATS:
            may = {process for process in PROCESSES if topic.key_for("*") in keys(process, "put")}
            roles = {process for process, played in PROCESSES.items() if topic.publisher in played}
            assert may == roles, topic.name
    assert keys("planner", "put") >= {"rackhand/*/chassis/command", "rackhand/*/bus/stats"}
    assert "rackhand/*/arm/command" not in keys("planner", "put")


def test_readers_and_callers_are_those_of_the_table_and_nodes_read_everything() -> None:
    for topic in TOPICS:
        may = {process for process in PROCESSES if topic.key_for("*") in keys(process, "declare_subscriber")}
        assert may == {name for name, played in PROCESSES.items() if set(topic.readers) & set(played)} | {"node"}
    for query in QUERIES:
        may = {process for process in PROCESSES if query.key_for("*") in keys(process, "query")}
        assert may == {name for name, played in PROCESSES.items() if set(query.callers) & set(played)}
    assert keys("node", "put") == keys("node", "liveliness_token") == set()


def test_a_service_announces_only_itself_and_its_roles() -> None:
    for process in set(PROCESSES) - {"node"}:
        alive = {key for key in keys(process, "liveliness_token") if "/alive/" in key}
        assert alive == {f"rackhand/*/alive/{name}" for name in (process, *PROCESSES[process])}


@pytest.fixture
def endpoint(tmp_path: Path) -> Iterator[str]:
    """A router that enforces the lists, for users whose password is their name."""
    address = f"tcp/127.0.0.1:{free_port()}"
    passwords = tmp_path / "passwords"
    passwords.write_text("".join(f"{name}:{name}\n" for name in ("router", *PROCESSES)))
    config = {
        "mode": "router",
        "listen": {"endpoints": [address]},
        "scouting": {"multicast": {"enabled": False}},
        "transport": {"auth": {"usrpwd": {"user": "router", "password": "router", "dictionary_file": str(passwords)}}},
        "access_control": SECTION,
    }
    with Bus(ServiceId("router", "cell"), BusConfig(config=write(tmp_path / "router.json5", config))):
        yield address


def write(path: Path, config: dict[str, Any]) -> Path:
    path.write_text(json.dumps(config))
    return path


@pytest.mark.system
def test_zenoh_lets_through_what_the_table_allows_and_nothing_else(endpoint: str, tmp_path: Path) -> None:
    with ExitStack() as stack:

        def connect(process: str, robot: str = "amr1") -> Bus:
            config = {
                "mode": "client",
                "connect": {"endpoints": [endpoint]},
                "scouting": {"multicast": {"enabled": False}},
                "transport": {"auth": {"usrpwd": {"user": process, "password": process}}},
            }
            path = write(tmp_path / f"{process}.json5", config)
            return stack.enter_context(Bus(ServiceId(process, robot), BusConfig(config=path)))

        planner, gateway, viewer = connect("planner"), connect("gateway", "cell"), connect("viewer", "cell")
        served = planner.inbox().watch_services().serve(topics.MOVES, "amr1")
        heard = viewer.inbox().subscribe(topics.PLANNING_STATE).subscribe(topics.PATH).subscribe(topics.MOVE_EVENT)
        planner.publisher(topics.PLANNING_STATE, "amr1").put(messages.planning(action_id=1))
        event = heard.get(timeout=20)
        assert event is not None and event.message.action_id == 1  # type: ignore[union-attr]
        late = gateway.inbox().subscribe(topics.PLANNING_STATE)
        event = late.get(timeout=20)
        assert event is not None and event.message.action_id == 1, "latched"  # type: ignore[union-attr]

        gateway.publisher(topics.PATH, "amr1").put(messages.path())  # which only the planner may
        planner.publisher(topics.PLANNING_STATE, "amr1").put(messages.planning(action_id=2))
        event = heard.get(timeout=20)
        assert event is not None and event.topic is topics.PLANNING_STATE  # type: ignore[union-attr]

        request = topics.MOVES.request.model_validate({"request": {"op": "get"}})
        with pytest.raises((CallTimeout, Unavailable)):
            viewer.call(topics.MOVES, request, "amr1", timeout=1.0)
        assert served.get(timeout=0) is None
        with pytest.raises(CallTimeout):  # the planner here does not answer, but it was asked
            gateway.call_when_served(topics.MOVES, request, "amr1", timeout=1.0)
        assert served.get(timeout=20) is not None
