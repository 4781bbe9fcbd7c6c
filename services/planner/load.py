"""What the chassis carries or is connected to. Kept across restarts, because no single sensor measures it:
the footprint, and later the undocking before the next move, derive from it."""

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
from rackhand.services.planner.database import Database
from rackhand.services.planner.errors import StoreError
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.geometry.polygon import convex_overlap
from rackhand.services.planner.geometry.se2 import Pose
from rackhand.services.planner.jacking import REACHED
from rackhand.services.planner.perception.chassis_state import ChassisState

Array = NDArray[np.float64]
KEY = "load"
LOADED = 5.0  # kg on the jack from which on it carries something


class LoadState(StrEnum):
    """``FREE``: nothing. ``UNDER_RACK``: a rack is above the chassis, on the floor. ``CARRYING``: on the jack.
    ``DOCKED``: on a charger's contacts."""

    FREE = "free"
    UNDER_RACK = "under_rack"
    CARRYING = "carrying"
    DOCKED = "docked"


class Load(BaseModel):
    """``rack``: outline of the rack, convex, rows x, y in metres; in the chassis frame while carried, in the map frame
    while it is on the floor; empty where none is known."""

    model_config = ConfigDict(frozen=True)

    state: LoadState = LoadState.FREE
    rack: tuple[tuple[float, float], ...] = ()

    def footprint(self, body: Footprint) -> Footprint:
        """The outline that must not touch anything: the body's; with a rack on it, the hull of both."""
        if self.state is not LoadState.CARRYING or not self.rack:
            return body
        points = np.vstack([body.polygon, np.array(self.rack)])
        return Footprint.of(points[ConvexHull(points).vertices])


@dataclass(frozen=True)
class Measured:
    """Measurements from which the load is derived. ``pose``: in the map, None while unknown."""

    state: ChassisState
    pose: Pose | None
    body: Footprint


def next_load(load: Load, now: Measured, default_rack: Array) -> Load:
    """The load after this tick; the same object where nothing changed.

    ``default_rack``: outline in the chassis frame of a rack that is lifted without having been measured before.
    """
    if load.state is LoadState.CARRYING:
        return _carried(load, now)
    if _lifts(now.state):
        return Load(state=LoadState.CARRYING, rack=_as_rows(_seen_from_chassis(load, now, default_rack)))
    if load.state is LoadState.UNDER_RACK:
        return _under_rack(load, now)
    contact = now.state.contacts
    if contact is not None and contact.charge_contact != (load.state is LoadState.DOCKED):
        return Load(state=LoadState.DOCKED if contact.charge_contact else LoadState.FREE)
    return load


def _lifts(state: ChassisState) -> bool:
    return state.jack is not None and state.jack.progress >= 1.0 - REACHED and state.jack.weight >= LOADED


def _carried(load: Load, now: Measured) -> Load:
    """Until the jack is down again: then the rack is on the floor where the chassis is."""
    jack = now.state.jack
    if jack is None or jack.progress > REACHED or now.pose is None:
        return load
    on_floor = se2.transformed(now.pose, np.array(load.rack)) if load.rack else np.empty((0, 2))
    return Load(state=LoadState.UNDER_RACK, rack=_as_rows(on_floor))


def _under_rack(load: Load, now: Measured) -> Load:
    """Until the body is out from under it."""
    if now.pose is None or not load.rack:
        return load
    body = se2.transformed(now.pose, now.body.polygon)
    return load if convex_overlap(body, np.array(load.rack)) else Load()


def _seen_from_chassis(load: Load, now: Measured, default_rack: Array) -> Array:
    if load.state is not LoadState.UNDER_RACK or not load.rack or now.pose is None:
        return default_rack
    chassis_from_map = se2.between(now.pose, np.zeros(3))
    return se2.transformed(chassis_from_map, np.array(load.rack))


def _as_rows(outline: Array) -> tuple[tuple[float, float], ...]:
    return tuple((float(x), float(y)) for x, y in outline)


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
