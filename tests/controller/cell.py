"""A controller with a perfect arm: it is where it was told to be one period later, and torques accelerate it."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin

from rackhand.schemas.arrays import Array
from rackhand.schemas.motion import (
    ArmCommand,
    ArmState,
    Following,
    Gripper,
    MotionDiagnostics,
    MotionEvent,
    MotionPath,
    MotionStatus,
)
from rackhand.services.controller import ik
from rackhand.services.controller.access.types import AccessConfig, AuditEntry
from rackhand.services.controller.commands.spec import CommandTable
from rackhand.services.controller.commands.table import COMMANDS
from rackhand.services.controller.controller import Controller
from rackhand.services.controller.motion.meter import Stopwatch, no_stopwatch
from rackhand.services.controller.warm_up import Inline

PERIOD_NS = 4_000_000
# Without their solids: they may go through themselves. ``tests.controller.station`` has arms that may not.
UR5E, FR3 = (replace(ik.load_arm(kind), solids=()) for kind in ("ur5e", "fr3"))
INERTIA = 1.0  # kg m², of every joint


class PerfectArm:
    """Requests go in as dictionaries, answers come out as such; ``advance`` lets simulation time pass."""

    def __init__(
        self,
        arm: ik.Arm = UR5E,
        executor: Any = None,
        lockstep: bool = True,
        stopwatch: Stopwatch = no_stopwatch,
        gripper: Gripper | None = None,
        reader: Any = None,
        commands: CommandTable = COMMANDS,
        **access: Any,
    ) -> None:
        self.arm = arm
        self.epochs = 0
        self.controller = Controller(
            arm,
            PERIOD_NS,
            executor or Inline(),
            self._epoch,
            AccessConfig(**access),
            stopwatch,
            reader=reader,
            commands=commands,
        )
        self.lockstep = lockstep
        self.gripper = gripper
        self.stamp = 0
        self.q, self.dq = arm.home.copy(), np.zeros(arm.n)
        self._before, self._data = self.dq, arm.model.createData()
        self.follows: Following | None = None  # it does not report what it follows
        self.answers: dict[int, dict[str, Any]] = {}
        self.events: list[MotionEvent] = []
        self.audit: list[AuditEntry] = []
        self.streams: list[tuple[str, dict[str, Any]]] = []
        self.errors: list[BaseException] = []
        self.status: MotionStatus | None = None
        self.diagnostics: MotionDiagnostics | None = None
        self.paths: list[MotionPath] = []
        self.history: list[tuple[int, Array, Array]] = []
        self.command: ArmCommand | None = None
        self._tickets = 0
        self.advance(0.0)

    def _epoch(self) -> str:
        self.epochs += 1
        return f"e{self.epochs}"

    # -- requests -----------------------------------------------------------------------------------------------------

    def send(self, session: str, text: str, stop: bool = False) -> int:
        self._tickets += 1
        (self.controller.stop_request if stop else self.controller.request)(session, text, self._tickets)
        self.take()
        return self._tickets

    def ask(self, session: str, /, **request: Any) -> dict[str, Any]:
        """The answer to a request, which must come without time passing."""
        ticket = self.send(session, json.dumps(request))
        self.controller.poll()
        self.take()
        assert ticket in self.answers, f"{request['command']} is not answered at once"
        return self.answers[ticket]

    def ok(self, session: str, /, **request: Any) -> None:
        answer = self.ask(session, **{"priority": 10, **request})
        assert answer["message"] == {"value": True, "code": 200, "detail": 0}, answer

    def get_status(self) -> dict[str, Any]:
        return dict(self.ask("watcher", command="getStatus")["message"])

    # -- time ---------------------------------------------------------------------------------------------------------

    def advance(self, seconds: float) -> None:
        """Ticks through the given time, the tick at its end included."""
        for _ in range(round(seconds * 1e9) // PERIOD_NS + (self.command is None)):
            if self.command is not None:
                self._move(self.command)
                self.stamp += PERIOD_NS
            self.tick()

    def tick(self) -> ArmCommand:
        self.command = self.controller.tick(self.measured(), self.lockstep)
        assert self.command.answers == self.stamp
        self.take()
        return self.command

    def halt(self) -> None:
        """It has come to rest by other means."""
        self.dq = self._before = np.zeros(self.arm.n)

    def measured(self) -> ArmState:
        """Its motors give what its motion needs: nothing touches it."""
        model, v = self.arm.model, self.dq
        a = (v - self._before) / (PERIOD_NS * 1e-9)
        self._before = v
        efforts = pin.rnea(model, self._data, self.q, v, a) + model.damping * v
        return ArmState(
            stamp=self.stamp,
            q=tuple(self.q),
            dq=tuple(v),
            efforts=tuple(efforts),
            wrench=(0.0,) * 6,
            gripper=self.gripper,
            follows=self.follows,
        )

    def until_rest(self, limit: float = 30.0) -> float:
        """Advances until the queue is empty and the arm stands; how long that took, seconds."""
        begun = self.stamp
        while self.stamp - begun < limit * 1e9:
            self.advance(0.004)
            if self.controller.motion.standing and not self.controller.busy and np.abs(self.dq).max() < 1e-9:
                return (self.stamp - begun) * 1e-9
        raise AssertionError(f"still moving after {limit} s")

    def _move(self, command: ArmCommand) -> None:
        dt, values = PERIOD_NS * 1e-9, np.array(command.values)
        if command.mode == "torque":
            self.dq = self.dq + values / INERTIA * dt
            self.q = self.q + self.dq * dt
        else:
            self.dq = (values - self.q) / dt
            self.q = values
        self.history.append((self.stamp + PERIOD_NS, self.q.copy(), self.dq.copy()))

    def take(self) -> None:
        output = self.controller.take()
        for ticket, text in output.replies:
            assert ticket not in self.answers, "answered twice"
            self.answers[ticket] = json.loads(text)  # type: ignore[index]
        self.events += output.events
        self.audit += output.audit
        self.streams += [(session, json.loads(text)) for session, text in output.streams]
        self.errors += output.errors
        self.status = output.status or self.status
        self.diagnostics = output.diagnostics or self.diagnostics
        self.paths += [output.path] if output.path is not None else []

    # -- what was seen ------------------------------------------------------------------------------------------------

    def tool(self, q: Array | None = None) -> Array:
        """Pose (3, 4) of the tool."""
        return ik.forward(self.arm, self.q if q is None else q)

    def driven(self) -> tuple[Array, Array]:
        """Joint positions and velocities (m, n) of every tick so far."""
        return np.array([q for _, q, _ in self.history]), np.array([dq for _, _, dq in self.history])

    def check_limits(self) -> None:
        """Position, velocity and acceleration limits held throughout."""
        q, dq = self.driven()
        limits = self.arm.limits
        assert (q >= limits.lower - 1e-9).all() and (q <= limits.upper + 1e-9).all()
        assert (np.abs(dq) <= limits.velocity * 1.001).all()
        ddq = np.diff(dq, axis=0) / (PERIOD_NS * 1e-9)
        assert (np.abs(ddq) <= limits.acceleration * 1.01).all(), np.abs(ddq).max(axis=0)


def pose(matrix: Array) -> dict[str, Any]:
    """A pose (3, 4) as on the wire."""
    rows = {f"Row{i + 1}": matrix[i, :3].tolist() for i in range(3)}
    return {"Position": matrix[:, 3].tolist(), "Orientation": {"Matrix": rows}}


def moved(matrix: Array, *offset: float) -> Array:
    shifted = matrix.copy()
    shifted[:, 3] += offset
    return shifted
