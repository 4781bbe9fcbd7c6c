"""One arm at run time: what it is told, what its drives do, and what it measures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import mujoco
import numpy as np

from schemas.motion import ArmCommand, ArmState
from services.sim import arm_reference as reference
from services.sim.arm_kinds import ArmKind
from services.sim.arm_model import CUP, FORCE, SUCTION, SUCTION_FORCE, TORQUE
from services.sim.arm_reference import Array, JointLimits, Motion, Segment
from services.sim.drive import COMMAND_LIFE_NS
from services.sim.errors import WorldFileError
from services.sim.fence import Fence

# The servo's poles, rad/s: fast beside any motion, slow beside its period of 1 ms.
BANDWIDTH = 100.0
# A joint that is held back drags its reference along at this distance (rad), instead of winding up.
MAX_ERROR = 0.05
# Commands come each 2 … 20 ms (s); before the second one has come, the interval is taken to be this.
SHORTEST, LONGEST, FIRST_INTERVAL = 0.002, 0.02, 0.004

Mode = Literal["position", "velocity", "torque", "hold"]


@dataclass(frozen=True)
class Order:
    """A command in force. ``velocity``: with which the stream that it belongs to passes the position;
    ``interval``: seconds since the command before it.
    """

    mode: Mode
    values: Array
    answers: int
    velocity: Array
    slope: Array
    interval: float


class Arm:
    """An arm of one model and data. ``home``: joint positions it starts with.

    Its servo is a computed-torque law at every physics step: mass matrix and bias forces are those of the physics, and
    the torque limits hold for the sum.
    """

    def __init__(self, name: str, kind: ArmKind, home: tuple[float, ...], model: Any, data: Any) -> None:
        self.name, self.kind = name, kind
        self._model, self._data = model, data
        self._find_addresses()
        self.limits = self._read_limits()
        self._check_home(home)
        self.suction = False  # whether the gripper's pump is on; no topic says so yet
        self._fence = Fence()
        self._order: Order | None = None
        self._taken: Order | None = None  # the order that the present segment follows
        self._mode: Mode = "hold"
        self._step = float(model.opt.timestep)
        data.qpos[self._qpos] = home
        self._torque = np.zeros(self.n)
        # Where the reference is, the difference of its last two positions over time, what it
        # follows and since when, and which joints it had to wait for.
        self._position, self._rate = np.array(home), np.zeros(self.n)
        self._segment: Segment = reference.braking(Motion(self._position, self._rate), self.limits, self._step)
        self._time = 0.0
        self._held_back = np.zeros(self.n, dtype=bool)

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.kind.home)

    def _find_addresses(self) -> None:
        model, prefix = self._model, f"{self.name}/"
        joints = [i for i in range(model.njnt) if model.joint(i).name.startswith(prefix)]
        if len(joints) != self.n:
            raise WorldFileError(f"arm {self.name}: home has {self.n} values, the MJCF {len(joints)} joints")
        first, dof = int(model.jnt_qposadr[joints[0]]), int(model.jnt_dofadr[joints[0]])
        self._joints = np.array(joints)
        self._qpos, self._qvel = slice(first, first + self.n), slice(dof, dof + self.n)
        motors = {int(model.actuator_trnid[i, 0]): i for i in range(model.nu)
                  if model.actuator_trntype[i] == mujoco.mjtTrn.mjTRN_JOINT}  # fmt: skip
        self._motors = np.array([motors[joint] for joint in joints])
        # The arm is a serial chain, so that its rows of the sparse mass matrix are a dense lower triangle.
        lower, self._mass_entries = np.tril_indices(self.n), np.zeros((self.n, self.n), dtype=np.intp)
        self._mass_entries[lower] = self._mass_entries.T[lower] = int(model.M_rowadr[dof]) + np.arange(len(lower[0]))
        self._damping = np.array(model.dof_damping[self._qvel])
        self._force, self._moment = (int(model.sensor(prefix + kind).adr[0]) for kind in (FORCE, TORQUE))
        names = {model.actuator(i).name: i for i in range(model.nu)}
        self._suction = names.get(prefix + SUCTION)
        self._cup = -1 if self._suction is None else int(model.geom(prefix + CUP).id)
        geoms = [i for i in range(model.ngeom) if model.geom(i).name.startswith(prefix)]
        # What the cup touches it is meant to touch.
        self.geoms = np.array([i for i in geoms if model.geom(i).name != prefix + CUP])

    def _read_limits(self) -> JointLimits:
        model = self._model
        return JointLimits(
            np.array(model.jnt_range[self._joints, 0]),
            np.array(model.jnt_range[self._joints, 1]),
            np.array(self.kind.velocity),
            np.array(self.kind.acceleration),
            np.array(model.jnt_actfrcrange[self._joints, 1]),
        )

    def _check_home(self, home: tuple[float, ...]) -> None:
        if np.any(home < self.limits.lower) or np.any(home > self.limits.upper):
            raise WorldFileError(f"arms.{self.name}.home: {home} is not within the joints' ranges")

    # -- what it is told ---------------------------------------------------------------------------------------------

    def fault_of(self, command: ArmCommand) -> str:
        """What is wrong with a command in itself; empty if nothing is."""
        if len(command.values) != self.n:
            return f"{len(command.values)} values; {self.name} has {self.n} joints"
        if not np.isfinite(command.values).all():
            return "values that are not finite"
        return ""

    def command(self, command: ArmCommand) -> bool:
        """Take a command. False if it is malformed, or of a grant that a newer one replaced."""
        if self.fault_of(command) or not self._fence.admit(command.token, command.answers):
            return False
        values, before = np.array(command.values), self._order
        gap = FIRST_INTERVAL if before is None else (command.answers - before.answers) * 1e-9
        interval = min(max(gap, SHORTEST), LONGEST) if before is None or gap > 0 else before.interval
        velocity = slope = np.zeros(self.n)
        if before is not None and before.mode == command.mode == "position":
            slope = (values - before.values) / gap if gap > 0 else before.slope
            # At the end of the interval the stream is faster than on average by half of what it gained.
            gained, most = slope - before.slope, self.limits.acceleration * interval
            velocity = slope + np.clip(gained, -most, most) / 2
        self._order = Order(command.mode, values, command.answers, velocity, slope, interval)
        return True

    def silence(self) -> None:
        """Nobody commands it any more: it brakes at once."""
        self._order = None

    # -- what it does ------------------------------------------------------------------------------------------------

    def begin(self, stamp: int) -> None:
        """What the instant that begins at ``stamp`` is to bring."""
        order = self._order
        if order is not None and stamp - order.answers >= COMMAND_LIFE_NS:
            order = self._order = None
        mode: Mode = "hold" if order is None else order.mode
        if self._mode == "torque" and mode != "torque":
            self._start_from(self._measured())
        if mode != self._mode or order is not self._taken:
            self._plan(mode, order, is_new=True)
        self._mode, self._taken = mode, order

    def servo(self) -> None:
        """Set the motors for one physics step, whose positions and velocities are computed already (``mj_step1``)."""
        data = self._data
        mass = data.M[self._mass_entries]
        bias = data.qfrc_bias[self._qvel]
        if self._mode == "torque" and self._taken is not None:
            asked = np.clip(self._taken.values, -self.limits.torque, self.limits.torque)
            torque = asked + bias + mass @ self._too_fast()
        else:
            # The physics takes the joints' damping implicitly, as part of the mass.
            wanted = self._wanted_acceleration()
            torque = mass @ wanted + self._step * self._damping * wanted + bias - data.qfrc_passive[self._qvel]
        self._torque = np.clip(torque, -self.limits.torque, self.limits.torque)
        data.ctrl[self._motors] = self._torque
        if self._suction is not None:
            data.ctrl[self._suction] = float(self.suction)

    def _wanted_acceleration(self) -> Array:
        """Go one step along the reference. Its velocities are differences of its positions, as those of the physics."""
        if self._time > self._segment.duration - self._step / 2:
            self._plan(self._mode, self._taken, is_new=False)
        now = self._measured()
        p, v = self._position, self._rate
        self._time += self._step
        planned = self._segment.position(self._time)
        p_next: Array = np.clip(planned, now.position - MAX_ERROR, now.position + MAX_ERROR)
        # The reference of a joint that is held back stands, or the joint's own shaking would drive it.
        held_back: Array = p_next != planned
        v_next = np.where(held_back, 0.0, (p_next - p) / self._step)
        acceleration = np.where(held_back | self._held_back, 0.0, (v_next - v) / self._step)
        self._position, self._rate, self._held_back = p_next, v_next, held_back
        error, error_rate = p - now.position, v - now.velocity
        return np.asarray(acceleration + BANDWIDTH**2 * error + 2 * BANDWIDTH * error_rate)

    def _plan(self, mode: Mode, order: Order | None, is_new: bool) -> None:
        """The next segment, from the present reference on. A command that is not new has ended its stream."""
        velocity = np.where(self._held_back, 0.0, self._segment.velocity(self._time))
        now, interval = Motion(self._position, velocity), FIRST_INTERVAL if order is None else order.interval
        duration = max(round(interval / self._step), 1) * self._step
        match mode:
            case "position" if order is not None:
                passing = order.velocity if is_new else np.zeros(self.n)
                self._segment = reference.towards(now, order.values, passing, self.limits, duration)
            case "velocity" if order is not None:
                self._segment = reference.at_velocity(now, order.values, self.limits, duration)
            case _:
                self._segment = reference.braking(now, self.limits, duration)
        self._time = 0.0

    def _start_from(self, motion: Motion) -> None:
        """Forget the reference so far; brake from ``motion`` on, unless something else is planned."""
        self._position, self._rate, self._time = motion.position, motion.velocity, 0.0
        self._held_back = np.zeros(self.n, dtype=bool)
        self._segment = reference.braking(motion, self.limits, self._step)

    def _too_fast(self) -> Array:
        """Torques know no speed: what brakes a joint that a torque has driven beyond its velocity limit (rad/s²)."""
        velocity = self._measured().velocity
        return -3 * BANDWIDTH * (velocity - np.clip(velocity, -self.limits.velocity, self.limits.velocity))

    def _pull(self) -> Array:
        """The force of the suction on what the cup touches, along the cup's axis."""
        touches = self.suction and bool((self._data.contact.geom == self._cup).any())
        return np.array([0.0, 0.0, SUCTION_FORCE if touches else 0.0])

    def _measured(self) -> Motion:
        return Motion(np.array(self._data.qpos[self._qpos]), np.array(self._data.qvel[self._qvel]))

    # -- what it measures --------------------------------------------------------------------------------------------

    def state(self, stamp: int) -> ArmState:
        """``efforts`` are the motors' torques; ``wrench`` is what the tool (its weight included) does to the flange."""
        measured, sensed = self._measured(), self._data.sensordata
        # MuJoCo's sensors measure what the flange does to the tool, and leave out the pull of an adhesion.
        force, moment = -sensed[self._force : self._force + 3], -sensed[self._moment : self._moment + 3]
        return ArmState(
            stamp=stamp,
            q=tuple(measured.position.tolist()),
            dq=tuple(measured.velocity.tolist()),
            efforts=tuple(self._torque.tolist()),
            wrench=(*(force + self._pull()).tolist(), *moment.tolist()),
        )
