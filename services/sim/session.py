"""A simulation under control: its pace, the commands of its participants, and the requests that change it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.motion import ArmCommand
from rackhand.schemas.refusal import RefusalCode, RequestRefused
from rackhand.schemas.service import ServiceId
from rackhand.schemas.world import (
    Advance,
    Clock,
    InjectFault,
    Inspect,
    Join,
    Leave,
    MoveObject,
    MoveRobot,
    Pause,
    Place,
    Push,
    Remove,
    Reset,
    Restore,
    SetSpeed,
    WorldReply,
    WorldRequest,
)
from rackhand.services.sim.chassis.drive import COMMAND_LIFE_NS
from rackhand.services.sim.errors import unknown
from rackhand.services.sim.pacing import CommandSchedule, Pacer
from rackhand.services.sim.simulation import Output, Simulation
from rackhand.worlds.world_model import CONTROL_STEP_NS

# Whose commands a participant's answers are: one service commands a chassis, another an arm.
CHASSIS_COMMANDER, ARM_COMMANDER = "planner", "controller"


@dataclass(frozen=True)
class Run:
    """One run of the world from time 0: its name, and the unix time of stamp 0 in ns."""

    name: str
    unix_ns: int


@dataclass
class Changes:
    """What must be published at once after a request. ``outputs``: those of the present control step."""

    clock: bool = False
    outputs: bool = False
    things: bool = False


@dataclass
class Session:
    """``build``: seed → a new simulation of the same world. ``new_run`` names the next run."""

    build: Callable[[int], Simulation]
    new_run: Callable[[], Run]
    seed: int
    pacer: Pacer
    changes: Changes = field(default_factory=Changes)

    def __post_init__(self) -> None:
        self.simulation = self.build(self.seed)
        self.run = self.new_run()
        self._schedule: CommandSchedule[ChassisCommand | ArmCommand] = CommandSchedule()

    @property
    def clock(self) -> Clock:
        return Clock(
            stamp=self.simulation.stamp,
            run=self.run.name,
            step_ns=self.simulation.control_step_ns,
            speed=self.pacer.speed,
            paused=self.pacer.paused and self.pacer.until is None,
            lockstep=self.pacer.lockstep,
            unix_ns=self.run.unix_ns,
        )

    def take_changes(self) -> Changes:
        changes, self.changes = self.changes, Changes()
        return changes

    def command(self, robot: str, command: ChassisCommand | ArmCommand) -> bool:
        """Take a command; in lockstep it takes effect when the command latency of its participant has passed.

        False if the command is not of this run, or not valid: see ``Simulation.admit``.
        """
        effective = self.pacer.effective(robot, command.answers)
        if effective is None:
            return True
        if not self.simulation.admit(robot, command):
            return False
        if self.pacer.lockstep:
            self._schedule.add(robot, effective, command)
        else:
            self.simulation.apply(robot, command)
        self.pacer.answered(robot, command.answers)
        return True

    def step(self) -> None:
        """Take the next control step, driven by the commands that are in force in it."""
        for robot, command in self._schedule.take_due(self.simulation.stamp):
            self.simulation.apply(robot, command)
        self.simulation.step()

    @property
    def outputs(self) -> tuple[Output, ...]:
        """What to publish of the present control step: the state of an arm at each period of its controller only."""
        simulation = self.simulation
        return simulation.outputs_with(arm for arm in simulation.arms if self.pacer.is_read(arm, simulation.stamp))

    def gone(self, service: ServiceId) -> bool:
        """The liveliness token of a service has vanished: its commands no longer count. True if it took part."""
        if service.service in (CHASSIS_COMMANDER, ARM_COMMANDER):
            self._silence(service.robot)
        return self.pacer.leave(service)

    def _silence(self, robot: str) -> None:
        self._schedule.drop(robot)
        self.simulation.silence(robot)

    def handle(self, request: WorldRequest) -> WorldReply | None:
        """Do what is asked. None: the answer is ``reply()`` once the pacer has paused again (``Advance``).

        Raises ``RequestRefused``, and has then changed nothing.
        """
        match request.request:
            case Join() as join:
                self._join(join)
            case Leave(robot=robot, service=service):
                self.gone(ServiceId(service, robot))
            case Pause(paused=paused):
                self.pacer.pause(paused)
                self.changes.clock = self.changes.things = True
            case Advance(duration_ns=duration):
                self._advance(duration)
                return None
            case SetSpeed(speed=speed):
                self.pacer.speed = speed
                self.changes.clock = True
            case Reset(seed=seed):
                self._reset(self.seed if seed is None else seed)
            case Place() | Remove() | Restore() | MoveRobot() | MoveObject() | Push() | InjectFault() as change:
                self.simulation.change(change)
                self.changes.things = True
            case Inspect():
                pass
        return self.reply()

    def reply(self) -> WorldReply:
        contact_log = self.simulation.contact_log
        return WorldReply(
            clock=self.clock,
            seed=self.seed,
            digest=self.simulation.digest,
            contact_count=contact_log.count,
            contacts=contact_log.rows,
            touches=self.simulation.touch_log.rows,
            participants=tuple(sorted(str(service) for service in self.pacer.participants)),
            command_stamps=dict(self.pacer.answers),
            faults=self.simulation.faults,
        )

    def _join(self, join: Join) -> None:
        simulation = self.simulation
        if join.robot not in {*simulation.robots, *simulation.arms}:
            raise unknown("robot", join.robot, [*simulation.robots, *simulation.arms])
        is_arm = join.robot in simulation.arms
        commander = ARM_COMMANDER if is_arm else CHASSIS_COMMANDER
        if join.service != commander:
            raise unknown("commanding service", join.service, (commander,))
        step_ns = simulation.control_step_ns if is_arm else CONTROL_STEP_NS
        if join.period_ns % step_ns:
            raise RequestRefused(
                RefusalCode.INVALID,
                f"period {join.period_ns} ns is not a multiple of the control step of {step_ns} ns",
            )
        latency_ns = join.latency * join.period_ns
        if latency_ns and latency_ns + join.period_ns > COMMAND_LIFE_NS:
            raise RequestRefused(
                RefusalCode.INVALID,
                f"command latency of {join.latency} periods of {join.period_ns} ns: a command would be older than "
                f"{COMMAND_LIFE_NS} ns before the next one takes effect",
            )
        service = ServiceId(join.service, join.robot)
        if self.pacer.lockstep and service not in self.pacer.participants:
            self._silence(join.robot)  # how many commands came before it joined depends on the load of the machine
        if is_arm:
            simulation.arms[join.robot].latency_ns = latency_ns
            simulation.arms[join.robot].efforts.period = join.period_ns // step_ns
        self.pacer.join(service, join.period_ns, simulation.stamp, latency_ns)
        self.changes.outputs = True  # it may have missed those of the present step

    def _advance(self, duration_ns: int) -> None:
        if not self.pacer.paused:
            raise RequestRefused(RefusalCode.PRECONDITION, "the simulation is running; pause it before advancing it")
        if self.pacer.until is not None:
            raise RequestRefused(
                RefusalCode.PRECONDITION, f"the simulation is already advancing to stamp {self.pacer.until}"
            )
        step_ns = self.simulation.control_step_ns
        self.pacer.advance(self.simulation.stamp + -(-duration_ns // step_ns) * step_ns)
        self.changes.clock = True

    def _reset(self, seed: int) -> None:
        self.simulation = self.build(seed)
        self.seed = seed
        self.run = self.new_run()
        self.pacer.reset()
        self._schedule.clear()
        self.changes.clock = self.changes.outputs = self.changes.things = True
