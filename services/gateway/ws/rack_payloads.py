"""The frames of the WebSocket topics about racks, made as in ``payloads``."""

from __future__ import annotations

from rackhand.schemas import planar, topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.racks import RackSpec, RackStates
from rackhand.schemas.websocket_racks import (
    DetectedRackFrame,
    DetectedRackStates,
    LoadFrame,
    MapRackStates,
    RackBox,
    RackLevelRow,
    RackPointRow,
    RackShape,
    SeenRacksFrame,
)
from rackhand.services.gateway.ws.facts import Facts
from rackhand.services.gateway.ws.payloads import payload, pose_frame


@payload(LoadFrame)
def load_state(facts: Facts) -> LoadFrame | None:
    load = facts.newest(topics.LOAD)
    if load is None:
        return None
    pose = rack_pose(facts)
    if load.spec is None or pose is None:
        return LoadFrame(state=load.state)
    return LoadFrame(state=load.state, rack=_shape(pose, load.spec))


@payload(SeenRacksFrame)
def seen_racks(facts: Facts) -> SeenRacksFrame | None:
    seen = facts.newest(topics.SEEN_RACKS)
    return None if seen is None else SeenRacksFrame(racks=[_shape(rack.pose, rack.spec) for rack in seen.racks])


@payload(DetectedRackFrame)
def detected_rack(facts: Facts) -> DetectedRackFrame | None:
    """The heading of the rack is that of the chassis under it, so the aligned box is the measured one."""
    found = facts.newest(topics.DETECTED_RACK)
    if found is None:
        return None
    if not found.detected or found.pose is None:
        return DetectedRackFrame(rack_detected=False)
    box = RackBox(pose=pose_frame(found.pose), width=round(found.width, 4), height=round(found.depth, 4))
    return DetectedRackFrame(rack_detected=True, frame="map", rack_box=box, rack_box_aligned=box)


@payload(DetectedRackStates)
def detected_rack_states(facts: Facts) -> DetectedRackStates | None:
    states = facts.newest(topics.DETECTED_RACK_STATES)
    return None if states is None else DetectedRackStates(map_uid=states.map_uid, racks=_rack_points(facts, states))


@payload(MapRackStates)
def map_rack_states(facts: Facts) -> MapRackStates | None:
    states = facts.newest(topics.MAP_RACK_STATES)
    return None if states is None else MapRackStates(map_uid=states.map_uid, racks=_rack_points(facts, states))


def rack_pose(facts: Facts) -> Pose2 | None:
    """Where in the map the rack is that the robot is under or carries; None without one, or while it is unknown."""
    load, robot = facts.newest(topics.LOAD), facts.newest(topics.POSE)
    if load is None or load.rack_pose is None or load.state != "carrying":
        return None if load is None else load.rack_pose
    if robot is None:
        return None
    x, y, yaw = planar.compose(planar.as_tuple(robot.pose), planar.as_tuple(load.rack_pose))
    return Pose2(x=x, y=y, yaw=yaw)


def _rack_points(facts: Facts, states: RackStates) -> list[RackPointRow]:
    return [
        RackPointRow(
            poi_id=point.poi_id,
            levels=[
                RackLevelRow(timestamp_ns=facts.unix_ns(level.stamp), level=level.level, state=level.state)
                for level in point.levels
            ],
        )
        for point in states.racks
    ]


def _shape(pose: Pose2, spec: RackSpec) -> RackShape:
    outline = [_rounded(planar.transform(planar.as_tuple(pose), x, y)) for x, y in spec.outline().tolist()]
    return RackShape(pose=pose_frame(pose), width=spec.width, depth=spec.depth, outline=outline)


def _rounded(point: tuple[float, float]) -> tuple[float, float]:
    return round(point[0], 4), round(point[1], 4)
