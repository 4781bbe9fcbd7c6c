"""One arm at run time: commands, drives, measurements."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import mujoco
import numpy as np

from rackhand.schemas.fencing import FencingGuard
from rackhand.schemas.motion import STREAM_INTERVALS, ArmCommand, ArmState, FencingToken, Following, Gripper
from rackhand.services.sim.arm.efforts import Efforts
from rackhand.services.sim.arm.servo import (
    HOLD,
    LATE,
    ON_TIME,
    POSITION,
    VELOCITY,
    Array,
    JointLimits,
    Joints,
    Reference,
    Servo,
    extrapolate,
    hold_to,
    let_torques,
    plan,
    stream_motion,
)
from rackhand.services.sim.arm.suction import Suction
from rackhand.services.sim.chassis.drive import COMMAND_LIFE_NS
from rackhand.services.sim.mjcf.arm_model import FORCE, TOOL, TORQUE
from rackhand.worlds.arm_model import ArmDescription
from rackhand.worlds.data import WorldFileError
from rackhand.worlds.world_model import ARM_INSTANT_NS

# Commands come each 2 … 20 ms (s); before the second one has come, the interval is taken to be this.
SHORTEST, LONGEST, FIRST_INTERVAL = 0.002, 0.02, 0.004
# For so many intervals after that of its newest command a stream is taken to be late and goes on as it went.
COASTS = STREAM_INTERVALS - 1

Mode = Literal["position", "velocity", "torque", "hold"]
_PLANS = {"position": POSITION, "velocity": VELOCITY}


@dataclass(frozen=True)
class Order:
    """A command in force. ``velocity``: with which the stream that it belongs to passes the position, 0 of a joint that
    jumps there; ``acceleration``: that of the stream; ``slope``: how fast it has come there, NaN of a stream's first;
    ``gap``: seconds since the command before it, NaN of a first; ``interval``: those from one command to the next where
    none is lost; ``token``: the grant it belongs to.
    """

    mode: Mode
    values: Array
    answers: int
    velocity: Array
    acceleration: Array
    slope: Array
    gap: float
    interval: float
    token: FencingToken


class Arm:
    """An arm of one model and data. ``home``: joint positions it starts with.

    Its servo is a computed-torque law at every physics step: mass matrix and bias forces are those of the physics, and
    the torque limits hold for the sum.
    """

    def __init__(self, name: str, kind: ArmDescription, home: tuple[float, ...], model: Any, data: Any) -> None:
        self.name, self.kind = name, kind
        self._model, self._data = model, data
        self._gripper = Suction(name, model, data)
        self._find_addresses()
        self.limits = self._read_limits()
        self._check_home(home)
        self._fence = FencingGuard()
        self._order: Order | None = None
        self._taken: Order | None = None  # the order that the present segment follows
        self._mode: Mode = "hold"
        self.latency_ns = 0  # between a measurement and when the command that answers it takes effect
        self._step = float(model.opt.timestep)
        data.qpos[self._qpos] = home
        self._torque, self._none, self._unknown = np.zeros(self.n), np.zeros(self.n), np.full(self.n, np.nan)
        self.efforts = Efforts(self.n, round(ARM_INSTANT_NS * 1e-9 / self._step))
        self._reference = Reference.at(np.array(home), self._none, self._step)
        self._coasts = 0  # how many segments more a stream may be late
        # Compiled here, for no command is to wait for it.
        self._plan("hold", None, ahead=0.0)
        let_torques(self._none, self._now, self.limits, self._torque)
        hold_to(self._reference, self._now, self.limits, self._step, self._torque)
        stream_motion(self._none, self._none, self._unknown, 0.0, FIRST_INTERVAL, FIRST_INTERVAL, self.limits)
        extrapolate(self._none, self._none, self._none, 0.0)

    @property
    def compiled_servo(self) -> Servo:
        """What ``Physics`` needs to drive the arm while ``only_follows`` holds."""
        return Servo(
            self._reference, self._now, self.limits, self._torque, self.efforts.total, self._motors, self._data.ctrl
        )

    @property
    def only_follows(self) -> bool:
        """Whether its servo only holds the joints to their reference: no torques, and the gripper is off."""
        return not self._gripper.on and self._mode != "torque"

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
        row, data = int(model.M_rowadr[dof]), self._data
        self._now = Joints(
            data.qpos[self._qpos],
            data.qvel[self._qvel],
            data.M[row : row + self.n * (self.n + 1) // 2],
            data.qfrc_bias[self._qvel],
            data.qfrc_passive[self._qvel],
            model.dof_damping[self._qvel],
        )
        self._force, self._moment = (int(model.sensor(prefix + kind).adr[0]) for kind in (FORCE, TORQUE))
        self._tool = int(model.site(prefix + TOOL).id)
        geoms = [i for i in range(model.ngeom) if model.geom(i).name.startswith(prefix)]
        # What the cup touches it is meant to touch.
        self.geoms = np.array([i for i in geoms if i != self._gripper.cup])

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

    # -- commands ----------------------------------------------------------------------------------------------------

    def fault_of(self, command: ArmCommand) -> str:
        """What is wrong with a command in itself; empty if nothing is."""
        if len(command.values) != self.n:
            return f"{len(command.values)} values; {self.name} has {self.n} joints"
        if not all(map(math.isfinite, command.values)):
            return "values that are not finite"
        return ""

    def admit(self, command: ArmCommand) -> bool:
        """False if the command is malformed, or of a grant that a newer one replaced."""
        return not self.fault_of(command) and self._fence.admit(command.token, command.answers)

    def command(self, command: ArmCommand) -> None:
        """Let an admitted command take effect."""
        self._gripper.on = command.suction
        values, before = np.array(command.values), self._order
        gap, interval = self._timing(command, before)
        velocity, acceleration, slope = self._none, self._none, self._unknown
        if command.mode == "position":
            values = np.clip(values, self.limits.lower, self.limits.upper)
            if before is not None and before.mode == "torque":
                # On with the velocity it has.
                velocity = slope = np.clip(self._now.velocity, -self.limits.velocity, self.limits.velocity)
        if before is not None and before.mode == command.mode == "position":
            passed = (command.answers - before.answers) * 1e-9
            apart = gap if math.isnan(before.gap) else (gap + before.gap) / 2
            velocity, slope, acceleration = stream_motion(
                values, before.values, before.slope, passed, gap, apart, self.limits
            )
        self._order = Order(
            command.mode, values, command.answers, velocity, acceleration, slope, gap, interval, command.token
        )

    def _timing(self, command: ArmCommand, before: Order | None) -> tuple[float, float]:
        """``gap`` and ``interval`` of the order to be."""
        if before is None:
            return math.nan, FIRST_INTERVAL
        passed = (command.answers - before.answers) * 1e-9
        if passed <= 0:
            return (FIRST_INTERVAL if math.isnan(before.gap) else before.gap), before.interval
        gap = min(max(passed, SHORTEST), LONGEST)
        # One long gap is a command that was lost; two are a slower stream.
        lost = gap > 1.25 * before.interval and gap > 1.25 * before.gap
        return gap, before.interval if lost else gap

    def silence(self) -> None:
        """Nobody commands it any more: it brakes at once. What its gripper holds it goes on holding."""
        self._order = None

    # -- what it does ------------------------------------------------------------------------------------------------

    def begin(self, stamp: int) -> None:
        """Prepare the control step that begins at ``stamp``."""
        self.efforts.begin()
        order = self._order
        if order is not None and stamp - order.answers >= COMMAND_LIFE_NS:
            order = self._order = None
        mode: Mode = "hold" if order is None else order.mode
        if self._mode == "torque" and mode != "torque":
            # What the reference was before is forgotten.
            self._reference.restart(self._now.position, self._now.velocity, self._step)
        if mode != self._mode or order is not self._taken:
            ahead = 0.0 if order is None else (stamp - order.answers - self.latency_ns) * 1e-9
            more = 0
            if order is not None and mode == "position" and ahead > self._step / 2:
                # What is corrected because it came late is corrected in more than an interval: no joint is jolted.
                more = min(math.ceil(ahead / order.interval - 0.01), COASTS)
            self._coasts = COASTS - more
            self._plan(mode, order, ahead, more)
        self._mode, self._taken = mode, order
        self._gripper.begin()

    def servo(self) -> None:
        """Set the motors for one physics step, whose positions and velocities are computed already (``mj_step1``)."""
        if self._mode == "torque" and self._taken is not None:
            let_torques(self._taken.values, self._now, self.limits, self._torque)
        else:
            self.continue_reference()
            hold_to(self._reference, self._now, self.limits, self._step, self._torque)
        control = self._data.ctrl
        control[self._motors] = self._torque
        self.efforts.total += self._torque
        self._gripper.act()

    def continue_reference(self) -> None:
        """Plan the next segment if the present one has ended: no command has come, the stream is late or has ended."""
        if not self._reference.has_ended(self._step):
            return
        order = self._taken
        if order is not None and self._coasts:
            self._coasts -= 1
            self._plan(self._mode, order, ahead=self._ahead + self._reference.timing[1])
        else:
            self._plan(self._mode, order, ahead=0.0, ended=True)

    def _plan(self, mode: Mode, order: Order | None, ahead: float, more: int = 0, ended: bool = False) -> None:
        """The next segment, from the present reference on. ``ahead``: by how many seconds the stream is further than
        its newest command says, negative where that came before its latency had passed. ``more``: for how many
        intervals more than one; ``ended``: it was the last.
        """
        self._ahead = ahead
        interval = FIRST_INTERVAL if order is None else order.interval
        duration = max(round((1 + more) * interval / self._step), 1) * self._step
        values = passing = self._none
        if order is not None and mode == "position" and not ended:
            values, passing = extrapolate(order.values, order.velocity, order.acceleration, ahead + more * interval)
        elif order is not None:
            values = order.values
        sharpest = LATE if more or ended else ON_TIME
        plan(self._reference, _PLANS.get(mode, HOLD), values, passing, self.limits, duration, sharpest)

    # -- what it measures --------------------------------------------------------------------------------------------

    def measured(self) -> tuple[Array, Array, Array]:
        """Positions and velocities of its joints, as in its state, and the torques of its motors."""
        return self._now.position, self._now.velocity, self._torque

    def state(self, stamp: int) -> ArmState:
        """``efforts`` are means since the state before; ``wrench``: what the tool, its weight included, does to the
        flange."""
        sensed, order = self._data.sensordata, self._order
        # MuJoCo's sensors measure what the flange does to the tool, and leave out the pull of an adhesion, which acts
        # along the cup's axis.
        pull = np.array([0.0, 0.0, self._gripper.pull])
        force, moment = -sensed[self._force : self._force + 3], -sensed[self._moment : self._moment + 3]
        return ArmState(
            stamp=stamp,
            q=tuple(self._now.position.tolist()),
            dq=tuple(self._now.velocity.tolist()),
            efforts=tuple(self.efforts.mean(self._torque).tolist()),
            wrench=(*(force + pull).tolist(), *moment.tolist()),
            follows=Following() if order is None else Following(token=order.token, answers=order.answers),
            gripper=Gripper(suction=self._gripper.on, holding=self._gripper.holding) if self._gripper.fitted else None,
        )
