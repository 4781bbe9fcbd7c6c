"""``/services/query_pose/charger_pose``: where the charger is, as the scan showed it or as it is registered."""

from __future__ import annotations

from typing import Any

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from tests.gateway import messages
from tests.gateway.harness import Gateway

PATH = "/services/query_pose/charger_pose"


def point(kind: object, x: float, y: float, yaw: object) -> dict[str, Any]:
    geometry = {"type": "Point", "coordinates": [x, y]}
    return {"type": "Feature", "id": f"{x}", "geometry": geometry, "properties": {"type": kind, "yaw": yaw}}


def test_the_pose_of_the_charger(gateway: Gateway) -> None:
    assert gateway.http.get(PATH).status_code == 503
    gateway.publish(topics.PLANNING_STATE, messages.planning(action_type="standard"))
    gateway.publish(topics.MAP, messages.current_map(features=[point("34", 1.0, 2.0, "0")]))
    answer = gateway.http.get(PATH)
    assert (answer.status_code, answer.json()) == (
        404,
        {"detail": "no charger (overlay type 9) is registered on the map in use"},
    )
    chargers = [point("9", 9.0, 9.0, None), point(9, 2.0, 3.0, "180")]
    gateway.publish(topics.MAP, messages.current_map(features=chargers))
    assert gateway.http.get(PATH).json() == {"pose": {"pos": [9.0, 9.0], "ori": 0.0}}, "the first: no pose is known"
    gateway.publish(topics.POSE, messages.pose(x=1.0, y=2.0))
    assert gateway.http.get(PATH).json() == {"pose": {"pos": [2.0, 3.0], "ori": 3.1416}}, "the nearest"
    charge = messages.planning(action_type="charge", target=None, intent_target=Pose2(x=2.1, y=3.1, yaw=3.0))
    gateway.publish(topics.PLANNING_STATE, charge)
    assert gateway.http.get(PATH).json() == {"pose": {"pos": [2.1, 3.1], "ori": 3.0}}, "as the scan showed it"
