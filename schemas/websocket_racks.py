"""Topics of the gateway's chassis WebSocket that are about racks; the conventions are those of ``websocket``."""

from __future__ import annotations

from typing import Literal

from rackhand.schemas.racks import LoadState, Occupancy
from rackhand.schemas.websocket import Frame, PoseFrame, WsTopic, Xy


class RackBox(Frame):
    """A rack as it is measured: `width` across and `height` along the heading of `pose`, over the legs' outer faces."""

    pose: PoseFrame
    width: float
    height: float


class DetectedRackFrame(WsTopic):
    """a search for a rack in the scan; sent only while a search runs"""

    TOPIC = "/detected_rack"
    LATCHED = False

    rack_detected: bool
    frame: Literal["map", "base_link"] | None = None
    rack_box: RackBox | None = None
    rack_box_aligned: RackBox | None = None


class RackLevelRow(Frame):
    """One level of a rack point; `timestamp_ns` (unix) is when it was last seen."""

    timestamp_ns: int
    level: int
    state: Occupancy


class RackPointRow(Frame):
    """A rack point of the map, by the id of its overlay feature."""

    poi_id: str
    levels: list[RackLevelRow]


class DetectedRackStates(WsTopic):
    """which of the rack points in view are occupied"""

    TOPIC = "/detected_rack_states"
    RATE = 2.0
    LATCHED = False

    map_uid: str
    racks: list[RackPointRow]


class MapRackStates(WsTopic):
    """which rack points of the map are occupied, as last seen"""

    TOPIC = "/map_rack_states"
    RATE = 2.0

    map_uid: str
    racks: list[RackPointRow]


class RackShape(Frame):
    """A rack in the map; `outline` with its margins."""

    pose: PoseFrame
    width: float
    depth: float
    outline: list[Xy]


class LoadFrame(WsTopic):
    """what the robot carries or is connected to, with the rack's place in the map (an extension)"""

    TOPIC = "/load_state"

    state: LoadState
    rack: RackShape | None = None


class SeenRacksFrame(WsTopic):
    """racks on the floor that scans have shown, at their measured places (an extension)"""

    TOPIC = "/seen_racks"
    RATE = 2.0

    racks: list[RackShape]
