"""Racks and items at run time: put elsewhere, removed and restored, pushed. What lies on a rack goes with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.planar import yaw_quaternion
from rackhand.services.sim.mjcf.layers import RUNNING_GEAR_GROUP, VISIBLE_GROUP
from rackhand.services.sim.mjcf.moved_geoms import geoms_moved
from rackhand.services.sim.mjcf.scene import LEGS, leg_name, leg_place
from rackhand.worlds.data import PoseTuple
from rackhand.worlds.world_model import RackKind, Surfaces, World

Array = NDArray[np.float64]
# Removed things are far off on the floor, one beside the other, where nothing else is.
PARKING_X, PARKING_Y, PARKING_STEP = 3000.0, 3000.0, 5.0


@dataclass(frozen=True)
class Frame:
    """A body's frame in the map: position (3,) and unit quaternion w, x, y, z (4,)."""

    position: Array
    quaternion: Array

    @classmethod
    def on(cls, height: float, pose: PoseTuple) -> Frame:
        """Upright, its origin at this height."""
        return cls(np.array([pose[0], pose[1], height]), np.array(yaw_quaternion(pose[2])))

    @property
    def planar(self) -> PoseTuple:
        w, x, y, z = self.quaternion
        yaw = float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
        return float(self.position[0]), float(self.position[1]), yaw

    def of(self, inner: Frame) -> Frame:
        """A frame given in this one, in the map."""
        position, quaternion = np.empty(3), np.empty(4)
        mujoco.mju_mulPose(position, quaternion, self.position, self.quaternion, inner.position, inner.quaternion)
        return Frame(position, quaternion)

    def seen(self, other: Frame) -> Frame:
        """A frame given in the map, in this one."""
        position, quaternion = np.empty(3), np.empty(4)
        mujoco.mju_negPose(position, quaternion, self.position, self.quaternion)
        return Frame(position, quaternion).of(other)


class Movables:
    """The racks and items of one model and data."""

    def __init__(self, world: World, model: Any, data: Any) -> None:
        self._world, self._model, self._data = world, model, data
        self._ids = {name: int(model.body(name).id) for name in (*world.racks, *world.items)}
        joints = {name: int(model.body_jntadr[body]) for name, body in self._ids.items()}
        self._qpos = {name: int(model.jnt_qposadr[joint]) for name, joint in joints.items()}
        self._qvel = {name: int(model.jnt_dofadr[joint]) for name, joint in joints.items()}
        self._hit: list[int] = []
        self.removed: dict[str, Frame] = {}
        """What was taken off the floor by its name → where it was."""

    def __contains__(self, name: str) -> bool:
        return name in self._ids

    @property
    def names(self) -> list[str]:
        return list(self._ids)

    def kind(self, rack: str) -> RackKind:
        """Raises ``KeyError`` for what is no rack."""
        return self._world.rack_kinds[self._world.racks[rack].kind]

    def qpos(self, name: str) -> int:
        """Where its position begins in ``qpos``."""
        return self._qpos[name]

    def frame(self, name: str) -> Frame:
        at = self._qpos[name]
        qpos = self._data.qpos
        return Frame(np.array(qpos[at : at + 3]), np.array(qpos[at + 3 : at + 7]))

    def geoms(self, name: str) -> list[int]:
        first = int(self._model.body_geomadr[self._ids[name]])
        return list(range(first, first + int(self._model.body_geomnum[self._ids[name]])))

    def surfaces(self, rack: str) -> Surfaces:
        """Where items can lie on the rack as it is now."""
        frame, kind = self.frame(rack), self.kind(rack)
        z = float(frame.position[2])
        return Surfaces(frame.planar, kind.size, tuple(z + level for level in kind.levels))

    def contents(self, name: str) -> list[str]:
        """The items whose middle is between or above the boards of the rack of that name; none of anything else."""
        if name not in self._world.racks:
            return []
        kind, frame = self.kind(name), self.frame(name)
        half = np.array(kind.size) / 2
        seen = {item: frame.seen(self.frame(item)).position for item in self._world.items}
        return [i for i, at in seen.items() if (np.abs(at[:2]) <= half).all() and at[2] > kind.underside]

    def put(self, name: str, frame: Frame) -> None:
        """Be there at rest, with its contents. The physics notice it at the next step."""
        before = self.frame(name)
        for part in (name, *self.contents(name)):  # found before anything has moved
            self._set(part, frame.of(before.seen(self.frame(part))))

    def remove(self, name: str) -> None:
        """Take it off the floor, with its contents."""
        self.removed[name] = self.frame(name)
        slot = list(self._ids).index(name)
        self.put(name, Frame.on(self.rest_height(name), (PARKING_X + PARKING_STEP * slot, PARKING_Y, 0.0)))

    def is_away(self, name: str) -> bool:
        """Whether it was removed, by itself or with the rack that it is on."""
        return bool(self._data.qpos[self._qpos[name]] > PARKING_X / 2)

    def hit(self, name: str, impulse: tuple[float, float], height: float | None, duration: float) -> None:
        """Act with this impulse (N·s) for so long; ``end_hits`` must follow then."""
        body = self._ids[name]
        force = np.array([*impulse, 0.0]) / duration
        middle = self._data.xipos[body]
        arm = np.array([0.0, 0.0, 0.0 if height is None else height - middle[2]])
        self._data.xfrc_applied[body] = np.concatenate([force, np.cross(arm, force)])
        self._hit.append(body)

    def end_hits(self) -> None:
        while self._hit:
            self._data.xfrc_applied[self._hit.pop()] = 0.0

    def hide_leg(self, rack: str, leg: int | None, hidden: bool) -> None:
        """Let the lidar see a leg or not (None: all of them). It can be touched as before."""
        for i in range(len(LEGS)) if leg is None else (leg,):
            geom = int(self._model.geom(leg_name(rack, i)).id)
            self._model.geom_group[geom] = RUNNING_GEAR_GROUP if hidden else VISIBLE_GROUP

    def resize(self, rack: str, factor: float) -> None:
        """Put its legs so many times as far from its middle as its kind has them."""
        kind = self.kind(rack)
        for i, corner in enumerate(LEGS):
            geom = int(self._model.geom(leg_name(rack, i)).id)
            self._model.geom_pos[geom, :2] = factor * leg_place(kind, corner)
        geoms_moved(self._model, self._data, self._ids[rack])

    def rest_height(self, name: str) -> float:
        """Of its origin, on the floor."""
        return 0.0 if name in self._world.racks else self._world.items[name].size[2] / 2

    def _set(self, name: str, frame: Frame) -> None:
        at, speed = self._qpos[name], self._qvel[name]
        self._data.qpos[at : at + 3] = frame.position
        self._data.qpos[at + 3 : at + 7] = frame.quaternion
        self._data.qvel[speed : speed + 6] = 0.0
