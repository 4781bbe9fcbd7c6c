"""Services that appear and disappear."""

from __future__ import annotations

from rackhand.schemas.service import ServiceId
from rackhand.services.gateway.presence import Services

PLANNER = ServiceId("planner", "amr1")


def test_services_come_go_and_come_back() -> None:
    services = Services([PLANNER])
    assert not services.all_up
    for alive, now in ((True, 10.0), (True, 11.0), (False, 12.0), (True, 13.0)):
        services.on_presence(PLANNER, alive, now)
    known = services.known[PLANNER]
    assert (services.all_up, known.alive, known.since, known.restarts) == (True, True, 13.0, 1)
    services.on_presence(PLANNER, False, 14.0)
    assert (services.all_up, known.since, known.restarts) == (False, 14.0, 1)


def test_progress_is_the_share_of_the_expected_services() -> None:
    services = Services([PLANNER, ServiceId("sim", "world")])
    services.on_presence(ServiceId("viewer", "cell"), True, 1.0)
    assert services.progress == 0.0
    services.on_presence(PLANNER, True, 1.0)
    assert services.progress == 0.5
    assert Services().progress == 1.0
