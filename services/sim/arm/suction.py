"""The suction gripper: what seals its cup is attached to it until the load is more than the suction can hold.

Friction of contacts lets a load creep, a sealed cup does not: once something movable seals the cup, a weld constraint
holds it where it is. The weld is released where the load on the seal is beyond what atmospheric pressure on a cup
holds: pull and tilting moment together beyond the suction force (a moment M lifts the rim of a cup of radius r as a
pull of M / r would), or shear beyond the share of that force that the friction of the lip carries.
"""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from rackhand.services.sim.mjcf.arm_model import CUP, SEAL, SEALS, SHEAR_SHARE, SUCTION, SUCTION_FORCE, TOOL
from rackhand.worlds.arm_model import GRIPPER_LENGTH, GRIPPER_RADIUS

_LEAKS = 10  # control steps in a row of too great a load until air has come in
_SLIPPED = 0.01  # m off where it was attached: it was taken away


class Suction:
    """Of the arm ``name``; there is none where ``fitted`` is False. ``on``: the pump; ``holding``: something seals."""

    def __init__(self, name: str, model: Any, data: Any) -> None:
        self._model, self._data = model, data
        self.on = self.holding = False
        self._overloaded = 0
        pumps = [i for i in range(model.nu) if model.actuator(i).name == f"{name}/{SUCTION}"]
        self.fitted = bool(pumps)
        self.cup = self._pump = self._seal = -1
        if self.fitted:
            self._pump, self.cup = pumps[0], int(model.geom(f"{name}/{CUP}").id)
            self._seal = int(model.equality(f"{name}/{SEAL}").id)
        self._tool, self._site = int(model.body(f"{name}/{TOOL}").id), int(model.site(f"{name}/{TOOL}").id)

    @property
    def pull(self) -> float:
        """N with which the adhesion, which the force sensor does not see, pulls at the cup."""
        return float(SUCTION_FORCE * self._data.ctrl[self._pump]) if self.fitted else 0.0

    def begin(self) -> None:
        """Between two steps, with the forces of the last one: lets go where the pump is off or the load too great."""
        if not self.fitted or not self._data.eq_active[self._seal]:
            return
        self._overloaded = self._overloaded + 1 if self._is_overloaded() else 0
        if not self.on or self._is_taken_away() or self._overloaded >= _LEAKS:
            self._release()

    def act(self) -> None:
        """Before the forces of a step are computed: pulls at what seals the cup, and attaches it."""
        if not self.fitted:
            return
        attached = bool(self._data.eq_active[self._seal])
        if not attached:
            sealing = self._sealing() if self.on else None
            self.holding = sealing is not None
            if sealing is not None and self._model.body_dofnum[sealing]:
                self._attach(sealing)
        self._data.ctrl[self._pump] = float(self.holding and not attached)

    def _sealing(self) -> int | None:
        """The body that faces the mouth of the cup; at its side the cup would only draw air."""
        contact = self._data.contact
        touching = np.flatnonzero((contact.geom == self.cup).any(axis=1))
        along = np.abs(contact.frame[touching, :3] @ self._axis())
        for i in touching[along > SEALS].tolist():
            geom = next(g for g in contact.geom[i].tolist() if g != self.cup)
            return int(self._model.geom_bodyid[geom])
        return None

    def _attach(self, body: int) -> None:
        """Welds ``body`` to the tool as it is now, about the middle of the cup's rim."""
        model, data = self._model, self._data
        turn, rim = data.xmat[body].reshape(3, 3), self._rim()
        model.eq_obj2id[self._seal] = body
        values = model.eq_data[self._seal]
        values[:3] = turn.T @ (rim - data.xpos[body])
        values[3:6] = self._turn().T @ (rim - data.xpos[self._tool])
        inverse = np.empty(4)
        mujoco.mju_negQuat(inverse, data.xquat[self._tool])
        mujoco.mju_mulQuat(values[6:10], inverse, data.xquat[body])
        data.eq_active[self._seal] = 1

    def _release(self) -> None:
        """What hung still would sleep from now on, were it not as fast as after a step of falling."""
        model, data, body = self._model, self._data, int(self._model.eq_obj2id[self._seal])
        data.eq_active[self._seal] = 0
        self.holding = False
        first = int(model.body_dofadr[body])
        data.qvel[first : first + 3] += model.opt.gravity * model.opt.timestep

    def _is_taken_away(self) -> bool:
        body, data = int(self._model.eq_obj2id[self._seal]), self._data
        sealed = data.xpos[body] + data.xmat[body].reshape(3, 3) @ self._model.eq_data[self._seal, :3]
        return bool(np.linalg.norm(sealed - self._rim()) > _SLIPPED)

    def _is_overloaded(self) -> bool:
        data, axis = self._data, self._axis()
        rows = np.flatnonzero((data.efc_type == mujoco.mjtConstraint.mjCNSTR_EQUALITY) & (data.efc_id == self._seal))
        if rows.size != 6:
            return False
        load = data.efc_force[rows]
        force, moment = load[:3], 0.5 * load[3:]  # the rows of the turn are of half angles
        pull = float(force @ axis)
        shear = float(np.linalg.norm(force - pull * axis))
        tilting = float(np.linalg.norm(moment - (moment @ axis) * axis)) / GRIPPER_RADIUS
        return pull + tilting > SUCTION_FORCE or shear > SHEAR_SHARE * SUCTION_FORCE

    def _turn(self) -> NDArray[np.float64]:
        return np.asarray(self._data.xmat[self._tool].reshape(3, 3))

    def _axis(self) -> NDArray[np.float64]:
        """From the flange to the rim, in the world."""
        return np.asarray(self._data.site_xmat[self._site][2::3])

    def _rim(self) -> NDArray[np.float64]:
        return np.asarray(self._data.site_xpos[self._site] + GRIPPER_LENGTH * self._axis())
