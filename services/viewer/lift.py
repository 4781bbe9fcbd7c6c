"""A lift: its cabin at every floor, the doors as far as they are open, and its state in words."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rackhand.schemas.base import Pose2
from rackhand.schemas.lift import LiftFloor, LiftModel, LiftState
from rackhand.schemas.planar import as_tuple, transform
from rackhand.services.viewer import colours
from rackhand.services.viewer.items import Drawing, Item, Note
from rackhand.services.viewer.shapes import ink, pen

FLOOR_Z, SIGN_Z = 0.03, 2.2


class LiftView:
    """Keeps the model, which the state is drawn with, and the state as last logged."""

    def __init__(self, lift: str) -> None:
        self.lift = lift
        self._model: LiftModel | None = None
        self._said = ""

    def begin(self) -> Iterable[Item]:
        return ()

    def model(self, model: LiftModel) -> Iterable[Item]:
        self._model = model
        outlines = [_cabin(floor.pose, model) for floor in model.floors]
        lines = rr.LineStrips3D(outlines, colors=ink(colours.AREA), radii=pen(2.0))
        yield Drawing(f"{self.lift}/cabin", (lines,), static=True)

    def state(self, state: LiftState) -> Iterable[Item]:
        said = in_words(state)
        if said != self._said:
            self._said = said
            yield Note(f"{self.lift}/log", said)
        if self._model is None:
            return
        leaves = [leaf for floor in self._model.floors for leaf in _leaves(floor, self._model, state)]
        shade = colours.WALL if state.blocked else colours.SLOW
        yield Drawing(f"{self.lift}/doors", (rr.LineStrips3D(leaves, colors=ink(shade), radii=pen(4.0)),), lasting=True)
        signs = [(floor.pose.x, floor.pose.y, SIGN_Z) for floor in self._model.floors]
        labels = [f"{self.lift} {floor.name}: {said}" for floor in self._model.floors]
        tags = rr.Points3D(signs, radii=0.0, colors=colours.NAME, labels=labels, show_labels=True)
        yield Drawing(f"{self.lift}/state", (tags,), lasting=True)


def in_words(state: LiftState) -> str:
    """Where the cabin is or goes, its door, and who has it."""
    where = f"{state.floor} to {state.target}" if state.moving else f"at {state.floor}, door {state.door}"
    blocked = ", blocked" if state.blocked else ""
    return f"{where}{blocked}, {f'held by {state.holder}' if state.holder else 'free'}"


def _leaves(floor: LiftFloor, model: LiftModel, state: LiftState) -> list[NDArray[np.float64]]:
    """The two leaves of a floor's door on the floor, each a line (2, 3); they slide aside to open."""
    opening = state.opening if floor.name == state.floor and not state.moving else 0.0
    half = model.door_width / 2
    sides = [(side * half * opening, side * half * (1.0 + opening)) for side in (1.0, -1.0)]
    return [_line(floor.pose, [(model.door_at, inner), (model.door_at, outer)]) for inner, outer in sides]


def _cabin(pose: Pose2, model: LiftModel) -> NDArray[np.float64]:
    x, y = model.depth / 2, model.width / 2
    return _line(pose, [(x, y), (-x, y), (-x, -y), (x, -y), (x, y)])


def _line(pose: Pose2, points: list[tuple[float, float]]) -> NDArray[np.float64]:
    """Points of the pose's frame in the map, just over the floor, (n, 3)."""
    return np.array([(*transform(as_tuple(pose), x, y), FLOOR_Z) for x, y in points])
