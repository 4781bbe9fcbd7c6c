"""The OpenAPI document against the server: what it says is what happens.

``RACKHAND_FUZZ_EXAMPLES`` sets how many requests are made in all (100 if not given), shared among the operations.
"""

from __future__ import annotations

import os

import pytest
import schemathesis
from hypothesis import HealthCheck, settings
from schemathesis.specs.openapi.checks import positive_data_acceptance

from rackhand.schemas import topics
from tests.gateway import messages
from tests.gateway.harness import Gateway, new_app

DOCUMENT = new_app().openapi()
OPERATIONS = sum(len(operations) for operations in DOCUMENT["paths"].values())
EXAMPLES = max(1, int(os.environ.get("RACKHAND_FUZZ_EXAMPLES", "100")) // OPERATIONS)
schema = schemathesis.openapi.from_dict(DOCUMENT)


@pytest.fixture(scope="module")
def started(server: Gateway) -> Gateway:
    """One that has heard from its robot: before, it may answer 503."""
    server.reset()
    server.publish(topics.CHASSIS_MODEL, messages.model())
    server.publish(topics.JACK, messages.jack())
    server.publish(topics.POSE, messages.pose())
    server.publish(topics.LOAD, messages.load("under_rack"))
    server.publish(topics.CHASSIS_STATUS, messages.status())
    server.publish(topics.PLANNING_STATE, messages.planning())
    server.publish(topics.MAP, messages.current_map())
    return server


@schema.parametrize()
@settings(
    max_examples=EXAMPLES, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck)
)
def test_every_operation_behaves_as_documented(case: schemathesis.Case, started: Gateway) -> None:
    """Of what the document allows, some is refused all the same: no target, not base64, a move that has ended."""
    case.call_and_validate(base_url=started.url, excluded_checks=[positive_data_acceptance])
