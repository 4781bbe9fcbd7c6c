"""Requests that change what is in a running world: each is refused with a reason, or done whole."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import Pose2
from rackhand.schemas.planar import as_tuple
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.schemas.world import Change, InjectFault, MoveObject, MoveRobot, Place, Push, Remove, Restore
from rackhand.services.sim.actors.movables import Frame
from rackhand.services.sim.actors.obstacles import PERSON_SIZE
from rackhand.services.sim.actors.walkers import Walker, make_route
from rackhand.services.sim.chassis.robot import Robot
from rackhand.services.sim.errors import unknown
from rackhand.services.sim.mjcf.layers import SOLID_BITS
from rackhand.services.sim.world.fault_injector import FaultInjector
from rackhand.services.sim.world.things import Things
from rackhand.services.sim.world.touch_log import TouchLog
from rackhand.worlds.data import PoseTuple
from rackhand.worlds.world_model import Surfaces, World

FARTHEST = 1000.0
# What lies on something sinks into it by less than this: deeper is an overlap.
RESTING_DEPTH = 0.003


class Editor:
    """``owner``: geom → name of the thing that it belongs to. ``controls``: of the current control step."""

    def __init__(
        self,
        world: World,
        model: Any,
        data: Any,
        things: Things,
        owner: Callable[[int], str],
        controls: NDArray[np.float64],
        touch_log: TouchLog,
    ) -> None:
        self._world, self._model, self._data = world, model, data
        self._robots, self._arms, self._lifts = things.robots, things.arms, things.lifts
        self._obstacles, self._movables = things.obstacles, things.movables
        self._owner, self._controls, self._touch_log = owner, controls, touch_log
        self._solid = np.flatnonzero(model.geom_contype & SOLID_BITS)
        self._faults = FaultInjector(world, model, data, things, owner, self._dispatch)

    def change(self, change: Change, stamp: int) -> None:
        """Raises ``RequestRefused``, and has then changed nothing."""
        try:
            self._dispatch(change, stamp)
        finally:
            mujoco.mj_kinematics(self._model, self._data)

    def _dispatch(self, change: Change, stamp: int) -> None:
        match change:
            case Place():
                self._place(change)
            case Remove(name=name):
                self._remove(name)
            case Restore(name=name):
                self._restore(name)
            case MoveRobot():
                self._move_robot(change)
            case MoveObject():
                self._move_object(change)
            case Push():
                self._push(change)
            case InjectFault():
                self._faults.inject(change, stamp)

    # -- obstacles and robots ----------------------------------------------------------------------------------------

    def _place(self, place: Place) -> None:
        self._check_name(place.name)
        for pose in (place.pose, *place.walk):
            check_pose(pose)
        size, walker = place.size, None
        if place.kind == "person" and len(size) == 3:  # the default size, which is a box's
            size = PERSON_SIZE
        if place.walk:
            try:
                route = make_route([(p.x, p.y) for p in (place.pose, *place.walk)], place.speed)
            except ValueError as error:
                raise RequestRefused(RefusalCode.INVALID, str(error)) from None
            walker = Walker(route)
        former = self._obstacles.placed.get(place.name)
        placed = self._obstacles.place(place.name, place.kind, size, as_tuple(place.pose), walker)
        mujoco.mj_kinematics(self._model, self._data)
        bodies = [robot.hull for robot in self._robots.values()] + [g for arm in self._arms.values() for g in arm.geoms]
        touched = self.overlap([self._obstacles.geom_of(placed)], np.array(bodies, dtype=np.intp))
        if touched is not None:
            self._obstacles.remove(place.name)
            if former is not None:
                self._obstacles.place(place.name, former.kind, former.size, former.pose, former.walker)
            raise RequestRefused(RefusalCode.INVALID, _overlaps(place.name, as_tuple(place.pose), touched))
        self._touch_log.relabel(self._obstacles.geom_of(placed), place.name)

    def _move_robot(self, move: MoveRobot) -> None:
        robot = self._robot(move.robot)
        check_pose(move.pose)
        with self._undone_if_refused():
            robot.put(as_tuple(move.pose))
            self.check_robot(robot, as_tuple(move.pose))
        robot.rest(self._controls)

    def check_robot(self, robot: Robot, pose: PoseTuple) -> None:
        """Raises ``RequestRefused`` if the body of the robot overlaps something where it is."""
        mujoco.mj_kinematics(self._model, self._data)
        own = np.flatnonzero(self._model.body_rootid[self._model.geom_bodyid] == robot.body)
        touched = self.overlap([robot.hull], np.setdiff1d(self._solid, own))
        if touched is not None:
            raise RequestRefused(RefusalCode.INVALID, _overlaps(robot.name, pose, touched))

    # -- racks and items ---------------------------------------------------------------------------------------------

    def _remove(self, name: str) -> None:
        if name not in self._movables:
            if name not in self._obstacles.placed:
                raise unknown("placed thing, rack or item", name, [*self._obstacles.placed, *self._movables.names])
            self._obstacles.remove(name)
            return
        self._check_is_there(name)
        self._movables.remove(name)

    def _restore(self, name: str) -> None:
        self._check_movable(name)
        former = self._movables.removed.get(name)
        if former is None:
            raise RequestRefused(RefusalCode.PRECONDITION, f"{name!r} was not removed; {self._removed()}")
        self._put(name, former)

    def _move_object(self, move: MoveObject) -> None:
        name, pose = move.name, as_tuple(move.pose)
        self._check_movable(name)
        check_pose(move.pose)
        if name not in self._movables.removed:
            self._check_is_there(name)
        if move.lies_on is None:
            if move.level is not None:
                raise RequestRefused(RefusalCode.INVALID, f"level {move.level} without lies_on: want a rack's name")
            height = 0.0
        else:
            height = self._surface(move, pose)
        self._put(name, Frame.on(height + self._movables.rest_height(name), pose))

    def _surface(self, move: MoveObject, pose: PoseTuple) -> float:
        """Height of what the item is to lie on."""
        if move.name in self._world.racks:
            raise RequestRefused(RefusalCode.INVALID, f"{move.name!r} is a rack, and is put on the floor only")
        surfaces = self._surfaces()
        if move.lies_on not in surfaces:
            raise unknown("box or rack", str(move.lies_on), surfaces)
        on = surfaces[move.lies_on]
        try:
            height = on.height(move.level)
        except ValueError as error:
            raise RequestRefused(RefusalCode.INVALID, f"{move.lies_on!r}: {error}") from None
        if not on.is_under(pose[0], pose[1]):
            at = _place_text(on.pose)
            raise RequestRefused(RefusalCode.INVALID, f"{_place_text(pose)} is not above {move.lies_on!r} at {at}")
        return height

    def _surfaces(self) -> dict[str, Surfaces]:
        there = [rack for rack in self._world.racks if not self._movables.is_away(rack)]
        boxes = {name: on for name, on in self._world.surfaces().items() if name not in self._world.racks}
        return boxes | {rack: self._movables.surfaces(rack) for rack in there}

    def _push(self, push: Push) -> None:
        name = push.name
        self._check_movable(name)
        self._check_is_there(name)
        if (push.shift is None) == (push.impulse is None):
            raise RequestRefused(RefusalCode.INVALID, f"push of {name!r}: want either shift or impulse")
        if push.impulse is not None:
            self._movables.hit(name, push.impulse, push.height, self._world.control_step_ns * 1e-9)
            return
        assert push.shift is not None
        check_pose(push.shift)
        frame = self._movables.frame(name)
        self._put(name, frame.of(Frame.on(0.0, as_tuple(push.shift))))

    def _put(self, name: str, frame: Frame) -> None:
        with self._undone_if_refused():
            parts = (name, *self._movables.contents(name))
            self._movables.put(name, frame)
            mujoco.mj_kinematics(self._model, self._data)
            geoms = [geom for part in parts for geom in self._movables.geoms(part)]
            touched = self.overlap(geoms, np.setdiff1d(self._solid, geoms), RESTING_DEPTH)
            if touched is not None:
                raise RequestRefused(RefusalCode.INVALID, _overlaps(name, frame.planar, touched))
        self._movables.removed.pop(name, None)

    # -- checks ------------------------------------------------------------------------------------------------------

    def overlap(self, geoms: Iterable[int], others: NDArray[np.intp], depth: float = 0.0) -> str | None:
        """The name of the first thing of the ``others`` that one of ``geoms`` goes into by ``depth`` or more."""
        model, data = self._model, self._data
        for geom in geoms:
            apart = np.linalg.norm(data.geom_xpos[others] - data.geom_xpos[geom], axis=1)
            near = others[apart < model.geom_rbound[others] + model.geom_rbound[geom]]
            for other in near:
                if other != geom and mujoco.mj_geomDistance(model, data, geom, int(other), 0.01, None) <= -depth:
                    return self._owner(int(other))
        return None

    @contextmanager
    def _undone_if_refused(self) -> Iterator[None]:
        qpos, qvel = np.array(self._data.qpos), np.array(self._data.qvel)
        try:
            yield
        except RequestRefused:
            self._data.qpos[:], self._data.qvel[:] = qpos, qvel
            raise

    def _check_name(self, name: str) -> None:
        if not re.fullmatch(r"[\w.-]{1,60}", name):
            raise RequestRefused(RefusalCode.INVALID, f"name {name!r}: want 1 … 60 letters, digits, '_', '-' or '.'")
        world = self._world
        if name in {*self._robots, *self._arms, *self._movables.names, *world.statics, *world.chargers, *world.lifts}:
            raise RequestRefused(RefusalCode.INVALID, f"{name!r} is already used in this world")

    def _check_movable(self, name: str) -> None:
        if name not in self._movables:
            raise unknown("rack or item", name, self._movables.names)

    def _check_is_there(self, name: str) -> None:
        if self._movables.is_away(name):
            raise RequestRefused(RefusalCode.PRECONDITION, f"{name!r} is not in the world now; {self._removed()}")

    def _removed(self) -> str:
        return f"removed: {sorted(self._movables.removed)}"

    def _robot(self, name: str) -> Robot:
        if name not in self._robots:
            raise unknown("robot", name, self._robots)
        return self._robots[name]


def _overlaps(name: str, pose: PoseTuple, other: str) -> str:
    return f"{name!r} would overlap {other!r} at {_place_text(pose)}"


def _place_text(pose: PoseTuple) -> str:
    return f"x {pose[0]:.3f}, y {pose[1]:.3f}, yaw {pose[2]:.3f}"


def check_pose(pose: Pose2) -> None:
    """Raises ``RequestRefused`` for a place so far off that lengths lose their meaning."""
    if max(abs(pose.x), abs(pose.y)) > FARTHEST or abs(pose.yaw) > FARTHEST:
        raise RequestRefused(RefusalCode.INVALID, f"pose {as_tuple(pose)}: want x, y and yaw within ±{FARTHEST:g}")
