"""The table of what is served of the chassis API, against the application: nothing is missing, nothing invented."""

from __future__ import annotations

import re

import pytest

from rackhand.schemas.api_coverage import ENDPOINTS, TOPICS, Endpoint
from rackhand.schemas.topics import websocket_topics
from tests.gateway.harness import Gateway

WORKING = [row for row in ENDPOINTS if row.works]
ABSENT = [row for row in ENDPOINTS if not row.works]


def test_every_row_is_there_once() -> None:
    rows = [(row.method, row.path) for row in ENDPOINTS]
    assert len(set(rows)) == len(rows)
    names = [topic.name for topic in TOPICS]
    assert len(set(names)) == len(names)


@pytest.mark.parametrize("row", WORKING, ids=lambda row: f"{row.method} {row.path}")
def test_what_works_is_a_route_of_the_application(gateway: Gateway, row: Endpoint) -> None:
    """No answer of 405, and none of an unknown URL: a missing thing of a known one is ``detail``."""
    answer = gateway.http.request(row.method, _filled(row.path), headers={"accept": "application/json"}, json={})
    assert answer.status_code != 405, answer.text
    assert answer.text != '{"detail":"Not Found"}', "no route takes it"
    assert answer.status_code < 500 or answer.status_code == 503, answer.text


@pytest.mark.parametrize("row", ABSENT, ids=lambda row: f"{row.method} {row.path}")
def test_what_this_chassis_has_not_is_answered_as_documented(gateway: Gateway, row: Endpoint) -> None:
    answer = gateway.http.request(row.method, _filled(row.path))
    assert (answer.status_code, answer.json()) == (row.status, {"detail": row.text})


def test_topics_that_work_are_those_of_the_table_of_topics() -> None:
    sent = {view.TOPIC for view in websocket_topics()}
    assert {topic.name for topic in TOPICS if topic.works and topic.direction == "sent"} <= sent
    assert not {topic.name for topic in TOPICS if not topic.works} & sent


def test_topics_without_a_source_can_be_enabled_and_stay_silent(gateway: Gateway) -> None:
    names = [_filled(topic.name) for topic in TOPICS if not topic.works and topic.direction == "sent"]
    with gateway.websocket() as socket:
        enabled = socket.ask({"enable_topic": names})["enabled_topics"]
        assert set(names) <= set(enabled)
        assert socket.ask({"topic": "/get_device_info_brief"})["topic"] == "/device_info_brief"


def test_topics_that_cannot_be_taken_are_answered_as_such(gateway: Gateway) -> None:
    for topic in TOPICS:
        if not topic.works and topic.direction == "taken":
            with gateway.websocket() as socket:
                assert socket.ask({"topic": _filled(topic.name)})["topic"] == "/error"


def _filled(path: str) -> str:
    return re.sub(r"{\w+}", "1", path)
