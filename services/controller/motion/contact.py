"""Contact: a joint that does not follow, a torque that the model does not explain, a force at the flange.

Pure: arm states and commanded positions in, what exceeds its bound out. No safety function: see docs/stops.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

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
        self._torques: list[float] = (bounds.torque * arm.limits.torque).tolist()
        self.reset()

    def reset(self) -> None:
        """The arm is another, or its states begin anew."""
        self._observer.reset()
        self._stamp: int | None = None
        self._usual = [0.0] * 3  # N, base axes
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
        worst = max(candidates, key=_Excess.share)
        self._seen = self._seen + 1 if worst.value > worst.bound else 0
        self._stamp = state.stamp
        return worst.contact() if self._seen >= self.bounds.ticks else None

    def _following(self, state: ArmState, commanded: Array) -> _Excess:
        bounds, goals = self.bounds, commanded.tolist()
        errors = [abs(q - goal) for q, goal in zip(state.q, goals, strict=True)]
        return _worst("following", errors, [bounds.following + bounds.following_time * abs(v) for v in state.dq], "rad")

    def _torque(self, state: ArmState) -> _Excess:
        return _worst("torque", [abs(torque) for torque in self._observer.see(state).tolist()], self._torques, "N·m")

    def _force(self, state: ArmState, rotation: Array) -> _Excess:
        x, y, z = state.wrench[:3]
        force = [row[0] * x + row[1] * y + row[2] * z for row in rotation.tolist()]
        dt = 0.0 if self._stamp is None else (state.stamp - self._stamp) * 1e-9
        share = min(dt / self.bounds.settling, 1.0) if dt > 0.0 else 1.0
        self._usual = [usual + (now - usual) * share for now, usual in zip(force, self._usual, strict=True)]
        return _Excess("force", None, math.dist(force, self._usual), self.bounds.force, "N")


class _Excess(NamedTuple):
    """What may be a contact: of these there are three at every tick."""

    kind: Literal["following", "torque", "force"]
    joint: int | None
    value: float
    bound: float
    unit: Literal["rad", "N·m", "N"]

    def share(self) -> float:
        return self.value / self.bound

    def contact(self) -> Contact:
        return Contact(kind=self.kind, joint=self.joint, value=self.value, bound=self.bound, unit=self.unit)


def _worst(
    kind: Literal["following", "torque"], values: list[float], bounds: list[float], unit: Literal["rad", "N·m"]
) -> _Excess:
    shares = [value / bound for value, bound in zip(values, bounds, strict=True)]
    joint = shares.index(max(shares))
    return _Excess(kind, joint, values[joint], bounds[joint], unit)


def describe(contact: Contact) -> str:
    """For the log and for answers."""
    where = "at the flange" if contact.joint is None else f"joint {contact.joint}"
    what = {"following": "off its command by", "torque": "pushed with", "force": "force of"}[contact.kind]
    return f"{where}: {what} {contact.value:.3g} {contact.unit}, bound {contact.bound:.3g} {contact.unit}"
