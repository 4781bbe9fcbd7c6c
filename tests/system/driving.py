"""Driving in system tests: bodies of moves, map features, and waiting for what the simulator says."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rackhand.schemas.world import WorldReply
from rackhand.testing import Cell, Chassis, Judge

Json = dict[str, Any]


class Driver(Chassis):
    """A client of the chassis with a judge of its own."""

    def __init__(self, cell: Cell, judge: Judge) -> None:
        super().__init__(cell)
        self.judge = judge

    def wait(self, holds: Callable[[WorldReply], bool], what: str) -> WorldReply:
        """Poll the world until something holds in it."""

        def found() -> WorldReply | None:
            world = self.judge.inspect()
            return world if holds(world) else None

        return self.cell.wait_for(found, what, 120.0)

    def wait_until_joined(self) -> None:
        """And until the planner has answered: what is asked of it then does not change its first answer."""
        self.wait(
            lambda world: "amr1/planner" in world.participants and "amr1" in world.command_stamps,
            "the planner has joined",
        )

    def wait_until_moving(self, start_x: float, start_y: float, by: float = 0.5) -> None:
        """Wait until the chassis has truly left that place."""

        def left() -> bool | None:
            pose = self.judge.true_pose("amr1")
            return True if (pose.x - start_x) ** 2 + (pose.y - start_y) ** 2 > by**2 else None

        self.cell.wait_for(left, "the chassis moves", 120.0)


def standard(x: float | None = None, y: float | None = None, ori: float | None = None, **more: Any) -> Json:
    """The body of a standard move."""
    target = {"target_x": x, "target_y": y, "target_ori": ori}
    return {"creator": "test", "type": "standard"} | {k: v for k, v in target.items() if v is not None} | more


def wall(*points: tuple[float, float]) -> Json:
    """A virtual wall along these points."""
    geometry = {"type": "LineString", "coordinates": [list(point) for point in points]}
    return {"type": "Feature", "id": "wall", "geometry": geometry, "properties": {"lineType": 2}}


def no_go(*points: tuple[float, float]) -> Json:
    """A region nobody may pass."""
    ring = [list(point) for point in (*points, points[0])]
    properties = {"regionType": 1, "blocked": False}
    return {
        "type": "Feature",
        "id": "zone",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": properties,
    }


def square(x: float, y: float, half: float) -> tuple[tuple[float, float], ...]:
    return ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))
