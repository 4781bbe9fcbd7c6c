"""One gateway for a fleet: each robot has its API under its name, the default one also without."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from websockets.exceptions import InvalidStatus

from rackhand.schemas import topics
from rackhand.schemas.world import Clock
from rackhand.services.gateway.settings import Settings
from rackhand.services.gateway.ws.payloads import PAYLOADS
from tests.gateway import messages
from tests.gateway.fake_bus import FakeBus
from tests.gateway.harness import UNPACED, Gateway, map_body, running_gateway

ROBOTS = ("amr1", "amr2")


class FakeFleet:
    """A fake robot for each name."""

    def __init__(self) -> None:
        self.robots = {name: FakeBus(name) for name in ROBOTS}

    async def acall(self, query: Any, request: Any, robot: str, timeout: float) -> Any:
        return await self.robots[robot].acall(query, request, robot, timeout)


@pytest.fixture
def fleet() -> Iterator[Gateway]:
    settings = Settings(robots=ROBOTS, planning_state_timeout=0, rates=dict.fromkeys(PAYLOADS, UNPACED))
    with running_gateway(settings) as gateway:
        object.__setattr__(gateway.shared, "bus", FakeFleet())
        yield gateway


def test_the_robots_are_listed(fleet: Gateway, gateway: Gateway) -> None:
    assert fleet.http.get("/robots").json() == [
        {"name": "amr1", "path": "/robots/amr1", "default": True},
        {"name": "amr2", "path": "/robots/amr2", "default": False},
    ]
    assert [row["name"] for row in gateway.http.get("/robots/").json()] == ["amr1"]


def test_each_robot_has_its_own_moves_and_the_default_one_two_paths(fleet: Gateway) -> None:
    assert fleet.http.post("/robots/amr2/chassis/moves", json={"target_ori": 2.0}).status_code == 201
    assert fleet.http.get("/chassis/moves").json() == []
    assert fleet.http.post("/chassis/moves/", json={"target_ori": 1.0}).json()["id"] == 1
    assert fleet.http.get("/robots/amr1/chassis/moves/1").json()["target_ori"] == 1.0
    assert fleet.http.get("/robots/amr2/chassis/moves/1/").json()["target_ori"] == 2.0


def test_urls_of_maps_name_the_robot(fleet: Gateway) -> None:
    row = fleet.http.post("/robots/amr2/maps", json=map_body()).json()
    assert row["image_url"] == f"{fleet.url}/robots/amr2/maps/1.png"
    assert fleet.http.get(row["image_url"]).status_code == 200
    assert fleet.http.get("/maps/1.png").status_code == 404


def test_an_unknown_robot_is_404_over_http_and_websocket(fleet: Gateway) -> None:
    answer = fleet.http.get("/robots/amr3/device/info")
    assert (answer.status_code, answer.json()) == (404, {"detail": "there is no robot 'amr3' here; known: amr1, amr2"})
    with pytest.raises(InvalidStatus, match="404"), fleet.websocket("/robots/amr3/ws/v2/topics"):
        pass


def test_state_is_kept_and_published_by_robot_and_the_clock_is_that_of_all(fleet: Gateway) -> None:
    clock: Clock = messages.clock(100)
    fleet.call(lambda: fleet.shared.fleet.on_world_message(topics.CLOCK, "world", clock))
    with fleet.websocket() as first, fleet.websocket("/robots/amr2/ws/v2/topics") as second:
        for client in (first, second):
            client.ask({"enable_topic": ["/battery_state"]})
        fleet.publish(topics.BATTERY, messages.battery(percentage=0.1), robot="amr1")
        fleet.publish(topics.BATTERY, messages.battery(percentage=0.2), robot="amr2")
        assert [client.receive()["percentage"] for client in (first, second)] == [0.1, 0.2]
    fleet.publish(topics.CHASSIS_MODEL, messages.model(), robot="amr2")
    assert fleet.http.get("/device/info").status_code == 503
    assert fleet.http.get("/robots/amr2/device/info").json()["device"]["sn"] == "amr2"


def test_files_belong_to_the_robot_whose_frame_names_them(fleet: Gateway) -> None:
    fleet.publish(topics.MAP, messages.current_map(), robot="amr2")
    with fleet.websocket("/robots/amr2/ws/v2/topics") as client:
        client.ask({"enable_topic": "/map_v2"})
        url = client.receive()["data_url"]
    assert fleet.http.get(f"/robots/amr2/{url}").status_code == 200
    assert fleet.http.get(f"/{url}").status_code == 404


def test_names_are_checked_and_every_robot_is_expected() -> None:
    with pytest.raises(ValueError, match="'a/b' is not a name"):
        Settings(robots=("a/b",))
    expected = [str(service) for service in Settings(robots=ROBOTS, arms=("arm1",)).expected_services()]
    assert expected == ["cell/router", "world/sim", "amr1/planner", "amr2/planner", "arm1/controller"]
