"""Contact: a joint that does not follow, a torque that the model does not explain, a force at the flange.

Pure: arm states and commanded positions in, what exceeds its bound out. No safety function: see docs/stops.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from rackhand.schemas.arrays import Array
from rackhand.schemas.crf_contact import Contact
from rackhand.schemas.motion import ArmState
from rackhand.services.controller import ik
from rackhand.services.controller.motion.disturbance import DisturbanceObserver


@dataclass(frozen=True)
class ContactBounds:
    """From where on something is a contact.

    ``following`` [rad] and ``following_time`` [s]: a joint may be off by following + following_time · |velocity|.
    ``torque``: share of a joint's torque limit that the model need not explain. ``force`` [N] at the flange, beside
    what has acted there for ``settling`` [s] (the weight of tool and load). ``ticks``: for so many ticks in a row.
    """

    following: float = 0.03
    following_time: float = 0.02
    torque: float = 0.12
    force: float = 80.0
    settling: float = 0.3
    ticks: int = 2


class ContactWatch:
    """Of one arm. ``take`` every state, ``see`` those at which there is a tick."""

    def __init__(self, arm: ik.Arm, bounds: ContactBounds = ContactBounds()) -> None:
        self.bounds = bounds
        self._observer = DisturbanceObserver(arm)
        self._torque_bound = bounds.torque * arm.limits.torque
        self.reset()

    def reset(self) -> None:
        """The arm is another, or its states begin anew."""
        self._observer.reset()
        self._stamp: int | None = None
        self._usual = np.zeros(3)
        self._seen = 0

    def take(self, state: ArmState) -> None:
        """A state, also one between two ticks."""
        self._observer.take(state)

    def see(self, state: ArmState, commanded: Array, rotation: Array, catching_up: bool = False) -> Contact | None:
        """What exceeds its bound most, as of ``state``, for whose stamp the joints ``commanded`` (n,) were sent.
        ``rotation`` (3, 3): of the flange in the base. ``catching_up``: the arm is off its command in any case."""
        candidates = [self._torque(state), self._force(state, rotation)]
        if not catching_up:
            candidates.append(self._following(state, commanded))
        worst = max(candidates, key=lambda contact: contact.value / contact.bound)
        self._seen = self._seen + 1 if worst.value > worst.bound else 0
        self._stamp = state.stamp
        return worst if self._seen >= self.bounds.ticks else None

    def _following(self, state: ArmState, commanded: Array) -> Contact:
        error = np.abs(np.array(state.q) - commanded)
        bound = self.bounds.following + self.bounds.following_time * np.abs(state.dq)
        return _worst("following", error, bound, "rad")

    def _torque(self, state: ArmState) -> Contact:
        return _worst("torque", np.abs(self._observer.see(state)), self._torque_bound, "N·m")

    def _force(self, state: ArmState, rotation: Array) -> Contact:
        force = rotation @ np.array(state.wrench[:3])
        dt = 0.0 if self._stamp is None else (state.stamp - self._stamp) * 1e-9
        if dt <= 0.0:
            self._usual = force
        else:
            self._usual = self._usual + (force - self._usual) * min(dt / self.bounds.settling, 1.0)
        beside = float(np.linalg.norm(force - self._usual))
        return Contact(kind="force", joint=None, value=beside, bound=self.bounds.force, unit="N")


def _worst(kind: Literal["following", "torque"], values: Array, bounds: Array, unit: Literal["rad", "N·m"]) -> Contact:
    joint = int(np.argmax(values / bounds))
    return Contact(kind=kind, joint=joint, value=float(values[joint]), bound=float(bounds[joint]), unit=unit)


def describe(contact: Contact) -> str:
    """For the log and for answers."""
    where = "at the flange" if contact.joint is None else f"joint {contact.joint}"
    what = {"following": "off its command by", "torque": "pushed with", "force": "force of"}[contact.kind]
    return f"{where}: {what} {contact.value:.3g} {contact.unit}, bound {contact.bound:.3g} {contact.unit}"
