"""A lift in physics: its doors, the light curtain between them, and what is in the cabin and rides with it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import Pose2
from rackhand.schemas.lift import LiftFloor, LiftModel, LiftRequest, LiftState
from rackhand.schemas.planar import between, transform
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.services.sim.actors.movables import Movables
from rackhand.services.sim.actors.obstacles import PERSON_SIZE, Obstacles
from rackhand.services.sim.chassis.noise import generator
from rackhand.services.sim.chassis.robot import Robot
from rackhand.services.sim.lift.controller import LiftController
from rackhand.services.sim.lift.traffic import Traffic
from rackhand.services.sim.mjcf.layers import VISIBLE_GROUP
from rackhand.services.sim.mjcf.lift_model import CABIN_DOOR_BEHIND, LEAVES, leaf_name
from rackhand.worlds.data import PoseTuple
from rackhand.worlds.world_model import World

# The light curtain: beams across the opening, outside the shaft's door and inside the cabin's, at these heights.
BEAM_OFF_DOOR, BEAM_HEIGHTS, BEAM_MARGIN = 0.06, (0.12, 0.5, 1.0), 0.02
SEEN = np.array([group == VISIBLE_GROUP for group in range(6)], dtype=np.uint8)
AJAR = 0.02  # how far doors must be open for something to be between them


class Lift:
    """One lift of a model and data, and all that may ride with it."""

    def __init__(
        self,
        name: str,
        world: World,
        model: Any,
        data: Any,
        robots: Mapping[str, Robot],
        obstacles: Obstacles,
        movables: Movables,
        seed: int,
    ) -> None:
        self.name, self.kind = name, world.lifts[name]
        self._world, self._model, self._data = world, model, data
        self._robots, self._obstacles, self._movables = robots, obstacles, movables
        floors = tuple(self.kind.floors)
        self.controller = LiftController(floors, round(self.kind.travel * 1e9))
        self._traffic = Traffic(floors, self.kind.traffic, generator(seed, name, "traffic"))
        leaves = {floor: [leaf_name(name, floor, leaf) for leaf in LEAVES] for floor in floors}
        self._motors = {floor: [int(model.actuator(leaf).id) for leaf in leaves[floor]] for floor in floors}
        self._qpos = {floor: [int(model.joint(leaf).qposadr[0]) for leaf in leaves[floor]] for floor in floors}
        self._qvel = {floor: [int(model.joint(leaf).dofadr[0]) for leaf in leaves[floor]] for floor in floors}
        self._commanded = dict.fromkeys(floors, 0.0)

    # -- requests and faults -----------------------------------------------------------------------------------------

    def handle(self, request: LiftRequest, stamp: int) -> LiftState:
        """Raises ``RequestRefused``."""
        return self.controller.handle(request, stamp)

    def fault(self, fault: str, active: bool, stamp: int) -> None:
        """Raises ``RequestRefused`` if a person has no room in the cabin."""
        match fault:
            case "lift_door_closes":
                self.controller.shut(active)
            case "lift_taken":
                self.controller.take(active, stamp)
            case "lift_occupied":
                self._occupy(active)

    @property
    def person(self) -> str:
        """Name of the person in the cabin, while the fault is there."""
        return f"{self.name}.person"

    def _occupy(self, active: bool) -> None:
        if self.person in self._obstacles.placed:
            if not active:
                self._obstacles.remove(self.person)
            return
        if not active:
            return
        inside = [name for name, robot in self._robots.items() if self._has(robot.pose, self.controller.floor)]
        if inside:
            raise RequestRefused(RefusalCode.PRECONDITION, f"{inside[0]!r} is in the cabin of {self.name!r}: no room")
        self._obstacles.place(self.person, "person", PERSON_SIZE, self._cabin, None)

    # -- once a step of the chassis ----------------------------------------------------------------------------------

    def drive(self, controls: NDArray[np.float64], stamp: int, dt: float) -> None:
        """Decide, and fill the columns of the doors in ``controls`` (steps × actuators) for the next ``dt`` seconds."""
        before = self.controller.floor
        if self.controller.step(stamp, self._opening(), self._is_blocked()) == "arrive":
            self._ride(before, self.controller.floor)
        request = self._traffic.ask(self.controller.state(stamp))
        if request is not None:
            with suppress(RequestRefused):  # someone else has it by now
                self.controller.handle(request, stamp)
        part = np.arange(1, len(controls) + 1) / len(controls)
        for floor, motors in self._motors.items():
            was = self._commanded[floor]
            wanted = 1.0 if floor == self.controller.floor and self.controller.doors_open else 0.0
            step = dt / self.kind.door_time
            now = self._commanded[floor] = was + min(max(wanted - was, -step), step)
            if now != was:
                self._wake(floor)
            for motor in motors:
                controls[:, motor] = (was + part * (now - was)) * self.kind.door / 2

    def state(self, stamp: int) -> LiftState:
        return self.controller.state(stamp)

    def model(self) -> LiftModel:
        kind = self.kind
        return LiftModel(
            floors=tuple(
                LiftFloor(name=floor, map=self._world.map_name(floor), pose=Pose2(x=x, y=y, yaw=yaw))
                for floor, (x, y, yaw) in kind.floors.items()
            ),
            depth=kind.cabin[0],
            width=kind.cabin[1],
            door_width=kind.door,
            door_at=kind.door_at,
        )

    # -- physics -----------------------------------------------------------------------------------------------------

    @property
    def _cabin(self) -> PoseTuple:
        """Where the cabin is."""
        return self.kind.floors[self.controller.floor]

    def _opening(self) -> float:
        """0 … 1: of the leaf that is furthest behind."""
        leaves = self._data.qpos[self._qpos[self.controller.floor]] / (self.kind.door / 2)
        return float(np.clip(leaves.min() if self.controller.doors_open else leaves.max(), 0.0, 1.0))

    def _wake(self, floor: str) -> None:
        """Doors that sleep stand still; a velocity whose bytes are not those of 0 wakes them, and does nothing else."""
        leaves = self._qvel[floor]
        velocities = self._data.qvel[leaves]
        self._data.qvel[leaves] = np.where(velocities == 0.0, -0.0, velocities)

    def _is_blocked(self) -> bool:
        if self.controller.moving or self._opening() < AJAR:
            return False
        half, geom = self.kind.door / 2 - BEAM_MARGIN, np.full(1, -1, np.int32)
        c, s = math.cos(self._cabin[2]), math.sin(self._cabin[2])
        across = np.array([s, -c, 0.0])
        for ahead in (self.kind.door_at + BEAM_OFF_DOOR, self.kind.door_at - CABIN_DOOR_BEHIND - BEAM_OFF_DOOR):
            x, y = transform(self._cabin, ahead, half)
            for height in BEAM_HEIGHTS:
                origin = np.array([x, y, height])
                far = mujoco.mj_ray(self._model, self._data, origin, across, SEEN, True, -1, geom, None)
                if 0 <= far < 2 * half:
                    return True
        return False

    def _ride(self, floor: str, to: str) -> None:
        """Shift all that is in the cabin from one floor to the other; nothing of it feels the way."""
        (x0, y0, _), (x1, y1, _) = self.kind.floors[floor], self.kind.floors[to]
        bodies = [robot.qpos for robot in self._robots.values() if self._has(robot.pose, floor)]
        movables = self._movables
        bodies += [movables.qpos(name) for name in movables.names if self._has(movables.frame(name).planar, floor)]
        for address in bodies:
            self._data.qpos[address : address + 2] += (x1 - x0, y1 - y0)
        for name, placed in list(self._obstacles.placed.items()):
            if placed.walker is None and self._has(placed.pose, floor):
                pose = (placed.pose[0] + x1 - x0, placed.pose[1] + y1 - y0, placed.pose[2])
                self._obstacles.placed[name] = replace(placed, pose=pose)
                self._obstacles.move(placed, pose)

    def _has(self, pose: PoseTuple, floor: str) -> bool:
        """Whether something there is in the cabin when that is at the floor."""
        x, y, _ = between(self.kind.floors[floor], pose)
        return -self.kind.cabin[0] / 2 <= x < self.kind.door_at and abs(y) <= self.kind.cabin[1] / 2
