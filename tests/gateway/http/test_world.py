"""Faults of a simulated world over HTTP."""

from __future__ import annotations

from rackhand.bus import Unavailable
from rackhand.schemas.faults import FAULTS
from tests.gateway.harness import Gateway


def test_faults_are_listed_caused_and_cleared(gateway: Gateway) -> None:
    rows = gateway.http.get("/world/faults").json()
    assert [row["name"] for row in rows] == list(FAULTS)
    fault = {"fault": "lidar_dead", "target": "amr1"}
    rows = {row["name"]: row for row in gateway.http.post("/world/faults", json=fault).json()}
    assert rows["lidar_dead"]["targets"] == ["amr1"]
    assert rows["lidar_dead"]["active"] == [{**fault, "part": None}]
    assert rows["lidar_blind"]["active"] == []
    cleared = gateway.http.post("/world/faults", json={**fault, "active": False}).json()
    assert all(row["active"] == [] for row in cleared)


def test_what_cannot_be_caused_is_refused_by_name(gateway: Gateway) -> None:
    unknown = gateway.http.post("/world/faults", json={"fault": "rust", "target": "amr1"})
    assert unknown.status_code == 400 and "rust" in unknown.text
    nobody = gateway.http.post("/world/faults", json={"fault": "lidar_dead", "target": "amr9"})
    assert nobody.status_code == 404 and "known: amr1" in nobody.json()["detail"]


def test_without_a_simulator_it_is_503(gateway: Gateway) -> None:
    gateway.bus.failure = Unavailable("no service answers world/control of world")
    assert gateway.http.get("/world/faults").status_code == 503
