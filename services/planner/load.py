"""What the chassis carries or is connected to. Kept across restarts, because no single sensor measures it:
the footprint and the undocking before the next move derive from it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError
from scipy.spatial import ConvexHull

from rackhand.runtime.store import Store
from rackhand.schemas.codec import explain
from rackhand.schemas.racks import LoadReport, RackSpec
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.planner.database import Database
from rackhand.services.planner.errors import StoreError
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.polygon import convex_overlap
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.jacking import LOADED, REACHED
from rackhand.services.planner.perception.chassis_state import ChassisState

Array = NDArray[np.float64]
KEY = "load"


class LoadState(StrEnum):
    """``FREE``: nothing. ``UNDER_RACK``: a rack is above the chassis, on the floor. ``CARRYING``: on the jack.
    ``DOCKED``: on a charger's contacts."""

    FREE = "free"
    UNDER_RACK = "under_rack"
    CARRYING = "carrying"
    DOCKED = "docked"


class Slip(StrEnum):
    """How far a carried rack has moved on the jack since it was lifted."""

    NONE = "none"
    SLIGHTLY = "slightly"
    SIGNIFICANTLY = "significantly"


class Load(BaseModel):
    """``rack_pose``: x, y, yaw of the rack's frame; in the chassis frame while carried, in the map frame while it is on
    the floor. None where no rack is known, as then is ``spec``.

    ``lifted_pose``: of a carried rack when it was measured first, from which its movement counts; None before.
    """

    model_config = ConfigDict(frozen=True)

    state: LoadState = LoadState.FREE
    spec: RackSpec | None = None
    rack_pose: tuple[float, float, float] | None = None
    lifted_pose: tuple[float, float, float] | None = None
    slipped: Slip = Slip.NONE

    @property
    def rack(self) -> Array:
        """Outline of the rack with its margins, in the frame of ``rack_pose``: corners (n, 2), none without a rack."""
        if self.spec is None or self.rack_pose is None:
            return np.empty((0, 2))
        return se2.transformed(np.array(self.rack_pose), self.spec.outline())

    def footprint(self, body: Footprint) -> Footprint:
        """The outline that must not touch anything: the body's; with a rack on it, the hull of both."""
        rack = self.rack
        if self.state is not LoadState.CARRYING or not len(rack):
            return body
        points = np.vstack([body.polygon, rack])
        return Footprint.of(points[ConvexHull(points).vertices])

    def check_nothing_above(self) -> None:
        """Raises ``RequestRefused`` with a rack above the chassis or on it."""
        if self.state in (LoadState.UNDER_RACK, LoadState.CARRYING):
            where = "under a rack" if self.state is LoadState.UNDER_RACK else "carrying a rack"
            raise RequestRefused(RefusalCode.PRECONDITION, f"the chassis is {where}; the jack must move freely")

    def report(self, stamp: int) -> LoadReport:
        """As it is published."""
        pose = None if self.rack_pose is None else se2.message(np.array(self.rack_pose))
        return LoadReport(stamp=stamp, state=self.state.value, spec=self.spec, rack_pose=pose)

    @staticmethod
    def under(spec: RackSpec, rack: Pose) -> Load:
        """Of a chassis under a rack that is on the floor at ``rack`` (map frame)."""
        return Load(state=LoadState.UNDER_RACK, spec=spec, rack_pose=se2.as_tuple(rack))


@dataclass(frozen=True)
class Measured:
    """Measurements from which the load is derived. ``pose``: in the map, None while unknown."""

    state: ChassisState
    pose: Pose | None
    body: Footprint


def next_load(load: Load, now: Measured, default_rack: RackSpec) -> Load:
    """The load after this tick; the same object where nothing changed.

    ``default_rack``: taken for a rack that is lifted without having been measured before, its middle at the chassis'
    origin.
    """
    if load.state is LoadState.CARRYING:
        return _carried(load, now)
    if _lifts(now.state):
        return _lifted(load, now, default_rack)
    if load.state is LoadState.UNDER_RACK:
        return _under_rack(load, now)
    contact = now.state.contacts
    if contact is not None and contact.charge_contact != (load.state is LoadState.DOCKED):
        return Load(state=LoadState.DOCKED if contact.charge_contact else LoadState.FREE)
    return load


def _lifts(state: ChassisState) -> bool:
    return state.jack is not None and state.jack.progress >= 1.0 - REACHED and state.jack.weight >= LOADED


def _lifted(load: Load, now: Measured, default_rack: RackSpec) -> Load:
    if load.state is not LoadState.UNDER_RACK or load.spec is None or load.rack_pose is None or now.pose is None:
        return Load(state=LoadState.CARRYING, spec=default_rack, rack_pose=(0.0, 0.0, 0.0))
    seen_from_chassis = se2.between(now.pose, np.array(load.rack_pose))
    return Load(state=LoadState.CARRYING, spec=load.spec, rack_pose=se2.as_tuple(seen_from_chassis))


def _carried(load: Load, now: Measured) -> Load:
    """Until the jack is down again: then the rack is on the floor where the chassis is."""
    jack = now.state.jack
    if jack is None or jack.progress > REACHED or now.pose is None:
        return load
    if load.spec is None or load.rack_pose is None:
        return Load(state=LoadState.UNDER_RACK)
    return Load.under(load.spec, se2.compose(now.pose, np.array(load.rack_pose)))


def _under_rack(load: Load, now: Measured) -> Load:
    """Until the body is out from under it."""
    rack = load.rack
    if now.pose is None or not len(rack):
        return load
    body = se2.transformed(now.pose, now.body.polygon)
    return load if convex_overlap(body, rack) else Load()


class LoadRecord(Protocol):
    """Where the load is kept."""

    load: Load

    def save(self, load: Load) -> None:
        """What is saved survives the process once it is written."""


class UnkeptLoad:
    """A load that nobody keeps."""

    def __init__(self) -> None:
        self.load = Load()

    def save(self, load: Load) -> None:
        self.load = load


class LoadStore:
    """In the planner's database, beside the moves."""

    def __init__(self, store: Store[Database]) -> None:
        self._store = store
        text = store.call(lambda database: database.get(KEY))
        try:
            self.load = Load() if text is None else Load.model_validate_json(text)
        except ValidationError as error:
            raise StoreError(f"the load in the store cannot be read: {explain(error)}") from error

    def save(self, load: Load) -> None:
        self.load = load
        text = load.model_dump_json()
        self._store.submit(lambda database: database.set(KEY, text), keep=True)
