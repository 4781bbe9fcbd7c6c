"""Causes and clears the faults of ``rackhand.schemas.faults``; some are made of other changes of the world."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import Any

import mujoco
import numpy as np

from rackhand.schemas import planar
from rackhand.schemas.base import Pose2
from rackhand.schemas.faults import FAULTS, FaultKind, amount_of
from rackhand.schemas.planar import as_tuple
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.schemas.world import ActiveFault, Change, FaultState, InjectFault, MoveRobot, Place, Push, Remove, Restore
from rackhand.services.sim.chassis.robot import Robot
from rackhand.services.sim.errors import unknown
from rackhand.services.sim.mjcf.layers import RUNNING_GEAR_GROUP, VISIBLE_GROUP
from rackhand.services.sim.mjcf.moved_geoms import geoms_moved
from rackhand.services.sim.world.things import Things
from rackhand.worlds.data import PoseTuple
from rackhand.worlds.world_model import World

CRATE = (0.8, 0.8, 0.8)
WORLD_BODY = 0


class FaultInjector:
    """``owner``: geom → name of the thing that it belongs to. ``change``: makes another change of the world."""

    def __init__(
        self,
        world: World,
        model: Any,
        data: Any,
        things: Things,
        owner: Callable[[int], str],
        change: Callable[[Change, int], None],
    ) -> None:
        self._world, self._model, self._data = world, model, data
        self._things, self._owner, self._change = things, owner, change
        self._before: dict[tuple[str, str], Any] = {}
        """Fault and target → what was so before, for faults that are cleared by setting that again."""
        self._active: list[ActiveFault] = []
        self._own_things = _without_parts(owner(geom) for geom in range(model.ngeom))
        self._targets = {
            "chassis": self._on_chassis,
            "rack": self._on_rack,
            "lift": self._on_lift,
            "charger": self._on_charger,
            "thing": self._on_thing,
            "obstacle": self._on_obstacle,
        }

    @property
    def state(self) -> FaultState:
        names = {
            "chassis": self._things.robots,
            "rack": self._world.racks,
            "lift": self._things.lifts,
            "charger": self._world.chargers,
            "thing": self._known_things(),
        }
        return FaultState(
            active=tuple(self._active),
            targets={kind: tuple(named) for kind, named in names.items()},
        )

    def inject(self, fault: InjectFault, stamp: int) -> None:
        """Raises ``RequestRefused``, and has then changed nothing."""
        kind = FAULTS[fault.fault]
        if fault.part is not None and fault.part >= kind.parts:
            known = f"0 … {kind.parts - 1}" if kind.parts else "none"
            raise _invalid(f"fault {fault.fault!r} has no part {fault.part}; it has {known}")
        if fault.pose is not None and kind.pose is None:
            raise _invalid(f"fault {fault.fault!r} takes no pose")
        if fault.pose is None and kind.pose is not None and fault.active:
            raise _invalid(f"fault {fault.fault!r} needs a pose: {_POSES[kind.pose]}")
        try:
            amount = amount_of(kind, fault.amount)
        except ValueError as error:
            raise _invalid(str(error)) from None
        self._targets[kind.target](kind, fault, amount, stamp)
        self._note(fault)

    # -- by what has them --------------------------------------------------------------------------------------------

    def _on_chassis(self, kind: FaultKind, fault: InjectFault, amount: float, stamp: int) -> None:
        robots = self._things.robots
        if fault.target not in robots:
            raise unknown("robot", fault.target, robots)
        robot = robots[fault.target]
        match kind.name:
            case "kidnapped":
                to = fault.pose or self._former(fault, "was not kidnapped")
                before = robot.pose
                self._change(MoveRobot(robot=robot.name, pose=to), stamp)
                self._keep(fault, _pose(before))
                return
            case "wheel_slip":
                robot.set_friction(amount if fault.active else None)
            case "battery_critical":
                self._set_battery(robot, fault, amount)
        if fault.active:
            robot.faults[kind.name] = amount
        else:
            robot.faults.pop(kind.name, None)

    def _set_battery(self, robot: Robot, fault: InjectFault, amount: float) -> None:
        if fault.active:
            self._keep(fault, robot.battery.percentage)
            robot.battery.set_percentage(amount)
        elif (before := self._before.pop(_key(fault), None)) is not None:
            robot.battery.set_percentage(before)

    def _on_rack(self, kind: FaultKind, fault: InjectFault, amount: float, stamp: int) -> None:
        name, movables = fault.target, self._things.movables
        if name not in self._world.racks:
            raise unknown("rack", name, self._world.racks)
        match kind.name:
            case "leg_hidden":
                movables.hide_leg(name, fault.part, hidden=fault.active)
            case "rack_missing":
                self._change(Remove(name=name) if fault.active else Restore(name=name), stamp)
            case "rack_slid":
                shift = fault.pose or self._former(fault, "did not slide")
                self._change(Push(name=name, shift=shift), stamp)
                self._keep(fault, _pose(planar.between(as_tuple(shift), (0.0, 0.0, 0.0))))
            case "rack_resized":
                movables.resize(name, amount if fault.active else 1.0)

    def _on_lift(self, kind: FaultKind, fault: InjectFault, _amount: float, stamp: int) -> None:
        if fault.target not in self._things.lifts:
            raise unknown("lift", fault.target, self._things.lifts)
        self._things.lifts[fault.target].fault(kind.name, fault.active, stamp)

    def _on_charger(self, _kind: FaultKind, fault: InjectFault, _amount: float, _stamp: int) -> None:
        name, chargers = fault.target, self._world.chargers
        if name not in chargers:
            raise unknown("charger", name, chargers)
        former: PoseTuple = self._before.get(_key(fault), (0.0, 0.0, 0.0))
        shift = as_tuple(fault.pose) if fault.active and fault.pose is not None else (0.0, 0.0, 0.0)
        self._before[_key(fault)] = shift
        middle = chargers[name].pose
        self._move_geoms(name, planar.compose(middle, former), planar.compose(middle, shift))
        for robot in self._things.robots.values():
            robot.dock_poses = tuple(
                _carried(charger.pose, self._before.get((fault.fault, other), (0.0, 0.0, 0.0)), charger.dock)
                for other, charger in chargers.items()
            )

    def _move_geoms(self, name: str, before: PoseTuple, after: PoseTuple) -> None:
        """Move what belongs to a static thing as a frame that goes from one pose to the other."""
        model = self._model
        for geom in self._geoms(name):
            x, y, _ = planar.compose(after, planar.between(before, (*model.geom_pos[geom, :2], 0.0)))
            model.geom_pos[geom, :2] = x, y
            quaternion, turned = np.array(planar.yaw_quaternion(planar.wrap(after[2] - before[2]))), np.empty(4)
            mujoco.mju_mulQuat(turned, quaternion, model.geom_quat[geom])
            model.geom_quat[geom] = turned
        geoms_moved(model, self._data, WORLD_BODY)

    def _on_thing(self, _kind: FaultKind, fault: InjectFault, _amount: float, _stamp: int) -> None:
        geoms = self._geoms(fault.target)
        if not geoms:
            raise unknown("thing", fault.target, sorted(self._known_things()))
        seen, unseen = (VISIBLE_GROUP, RUNNING_GEAR_GROUP)
        before, after = (seen, unseen) if fault.active else (unseen, seen)
        hidden = [geom for geom in geoms if self._model.geom_group[geom] == before]
        self._model.geom_group[hidden] = after

    def _on_obstacle(self, kind: FaultKind, fault: InjectFault, _amount: float, stamp: int) -> None:
        if not fault.active or fault.pose is None:
            self._change(Remove(name=fault.target), stamp)
        elif kind.name == "person_standing":
            self._change(Place(name=fault.target, kind="person", pose=fault.pose), stamp)
        else:
            self._change(Place(name=fault.target, pose=fault.pose, size=CRATE), stamp)

    def _note(self, fault: InjectFault) -> None:
        """Clearing a fault of all parts clears it of each."""
        here = [one for one in self._active if (one.fault, one.target) == _key(fault)]
        for one in here:
            if fault.part in (None, one.part):
                self._active.remove(one)
        if fault.active:
            self._active.append(ActiveFault(fault=fault.fault, target=fault.target, part=fault.part))

    # -- what was so before ------------------------------------------------------------------------------------------

    def _known_things(self) -> tuple[str, ...]:
        return (*self._own_things, *self._things.obstacles.placed)

    def _geoms(self, name: str) -> list[int]:
        return [geom for geom in range(self._model.ngeom) if self._owner(geom) == name]

    def _keep(self, fault: InjectFault, before: Any) -> None:
        """The first time only: until the fault is cleared, what was before it is so before all of them."""
        if fault.active:
            self._before.setdefault(_key(fault), before)
        else:
            self._before.pop(_key(fault), None)

    def _former(self, fault: InjectFault, why: str) -> Pose2:
        former = self._before.get(_key(fault))
        if not isinstance(former, Pose2):
            raise RequestRefused(RefusalCode.PRECONDITION, f"{fault.target!r} {why}")
        return former


_POSES = {"at": "x, y (m) and yaw (rad) in the map", "shift": "x, y (m) and yaw (rad) in its own frame"}


def _key(fault: InjectFault) -> tuple[str, str]:
    return fault.fault, fault.target


def _pose(pose: PoseTuple) -> Pose2:
    return Pose2(x=pose[0], y=pose[1], yaw=math.remainder(pose[2], math.tau))


def _carried(frame: PoseTuple, shift: PoseTuple, pose: PoseTuple) -> PoseTuple:
    """A pose in the map that moves with a frame that is shifted in itself."""
    return planar.compose(planar.compose(frame, shift), planar.between(frame, pose))


def _without_parts(names: Iterable[str]) -> tuple[str, ...]:
    """Each once, and none of a part of something."""
    return tuple(dict.fromkeys(name for name in names if "/" not in name))


def _invalid(text: str) -> RequestRefused:
    return RequestRefused(RefusalCode.INVALID, text)
