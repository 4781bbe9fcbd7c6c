"""Where the chargers are, by what the planner reports and the map shows."""

from __future__ import annotations

import math

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.maps import PointType, overlay_code
from rackhand.services.gateway.ws.facts import Facts


def charger_pose(facts: Facts) -> Pose2 | None:
    """Of the running or last move if that is a ``charge``, else of the charger on the map that is nearest to the robot
    (the first one while its pose is unknown); None without a charger. Map frame, as of a chassis on its contacts."""
    state, robot = facts.newest(topics.PLANNING_STATE), facts.newest(topics.POSE)
    if state is not None and state.action_type == "charge" and state.intent_target is not None:
        return state.intent_target
    registered = _registered(facts)
    if robot is None:
        return next(iter(registered), None)
    return min(registered, key=lambda at: math.hypot(at.x - robot.pose.x, at.y - robot.pose.y), default=None)


def _registered(facts: Facts) -> list[Pose2]:
    """The points of type 9 of the map in use, which the planner has checked."""
    current = facts.newest(topics.MAP)
    if current is None or current.map is None:
        return []
    poses = []
    for feature in current.map.overlays.get("features", []):
        properties = feature.get("properties") or {}
        if feature["geometry"]["type"] == "Point" and overlay_code(properties.get("type")) == PointType.CHARGER:
            x, y, *_ = feature["geometry"]["coordinates"]
            poses.append(Pose2(x=float(x), y=float(y), yaw=math.radians(float(properties.get("yaw") or 0.0))))
    return poses
