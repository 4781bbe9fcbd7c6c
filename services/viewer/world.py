"""What only a simulator publishes: the scene's geometry, and ground-truth poses."""

from __future__ import annotations

from collections.abc import Iterable

from rackhand.schemas.world import Clock, Objects, Scene, SceneGeom
from rackhand.services.viewer.geometry import Bounds, Group, draw, grouped, halls, is_same
from rackhand.services.viewer.items import BUS_LOG, Item, Note, Pose


class WorldView:
    """Keeps the scene as drawn, so that only what changed is drawn again."""

    def __init__(self, _world: str = "") -> None:
        self.bounds: Bounds | None = None
        self._drawn: dict[Group, tuple[SceneGeom, ...]] = {}
        self._pace: tuple[float | None, bool] | None = None

    def begin(self) -> Iterable[Item]:
        return ()

    def scene(self, scene: Scene) -> Iterable[Item]:
        """Removed bodies are drawn empty: static items cannot be cleared."""
        groups = grouped(scene)
        self.bounds = next(iter(halls(scene)), None)
        for group in {**groups, **self._drawn}:
            geoms = groups.get(group, ())
            if not is_same(geoms, self._drawn.get(group)):
                yield draw(group, geoms)
        self._drawn = groups

    def objects(self, objects: Objects) -> Iterable[Item]:
        for thing in objects.objects:
            yield Pose(thing.name, thing.position, thing.orientation)

    def clock(self, clock: Clock) -> Iterable[Item]:
        pace = (clock.speed, clock.paused)
        if pace != self._pace:
            self._pace = pace
            speed = "as fast as possible" if clock.speed is None else f"at {clock.speed:g} x real time"
            yield Note(BUS_LOG, "simulation paused" if clock.paused else f"simulation runs {speed}")
