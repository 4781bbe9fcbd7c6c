"""Simulator, planners and controllers joined in one process: a cell in lockstep without a bus, a socket or a clock.

with JoinedWorld("warehouse", folder) as world:
    world.chassis("amr1").post(type="standard", target_x=5.5, target_y=7.5)
    world.advance(10.0)

Time passes in ``advance`` only. What each core reads and answers is what its service would hand it; the services'
shells themselves are tested with processes in tests/system.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from pathlib import Path
from types import TracebackType
from typing import TypeVar

from rackhand.schemas.base import NANOSECONDS, Message, Pose2
from rackhand.schemas.lift import LiftRequest, LiftState
from rackhand.schemas.world import Advance, Inspect, Join, ObjectPose, Pause, Reset, WorldReply, WorldRequest
from rackhand.services.controller import ik
from rackhand.services.planner.settings import NavigationSettings
from rackhand.services.sim.chassis.noise import NoiseSettings
from rackhand.services.sim.pacing import Pacer
from rackhand.services.sim.session import Run, Session
from rackhand.services.sim.simulation import Output, Simulation
from rackhand.testing import planar
from rackhand.worlds.chassis_model import load_profiles
from rackhand.worlds.world_model import World, load_world
from tests.joined.arm import JoinedArm, warm_arm
from tests.joined.chassis import JoinedChassis

CHASSIS_TIMESTEP = 0.002
UNIX_NS = 1_700_000_000 * NANOSECONDS
T = TypeVar("T")


class JoinedWorld:
    """A paused world with a planner core for each chassis and a controller core for each arm.

    ``world`` is a name, a folder or a world; ``with_arms`` and ``with_chassis`` leave cores out whose robots a test
    does not need; without ``with_stations`` the controllers know nothing of what surrounds their arms. ``navigation``:
    of the planners.
    """

    def __init__(
        self,
        world: str | World,
        folder: Path,
        seed: int = 0,
        profile: str | None = None,
        noise: NoiseSettings | None = None,
        with_chassis: bool = True,
        with_arms: bool = True,
        with_stations: bool = True,
        navigation: NavigationSettings | None = None,
    ) -> None:
        loaded = load_world(world) if isinstance(world, str) else world
        if not with_arms:
            # The small physics step is there for the servos of arms.
            loaded = loaded.model_copy(update={"arms": {}, "timestep": CHASSIS_TIMESTEP})
        profiles = load_profiles(loaded, profile)
        settings = noise or NoiseSettings()
        runs = iter(range(1_000_000))
        self.session = Session(
            build=lambda chosen: Simulation(loaded, profiles, chosen, settings),
            new_run=lambda: Run(f"run{next(runs)}", UNIX_NS),
            seed=seed,
            pacer=Pacer(loaded.control_step_ns, None, lockstep=True, paused=True),
        )
        self._chassis = {}
        if with_chassis:
            self._chassis = {
                name: JoinedChassis(self, name, folder, navigation or NavigationSettings())
                for name in self.simulation.robots
            }
        arms = {name: warm_arm(loaded.arms[name].kind) for name in self.simulation.arms}
        if with_stations:
            arms = {name: ik.in_station(arm, loaded, name) for name, arm in arms.items()}
        self._arms = {name: JoinedArm(self, name, arm) for name, arm in arms.items()}
        self._begin()

    def __enter__(self) -> JoinedWorld:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for chassis in self._chassis.values():
            chassis.close()

    @property
    def simulation(self) -> Simulation:
        return self.session.simulation

    def chassis(self, name: str = "amr1") -> JoinedChassis:
        return self._chassis[name]

    def arm(self, name: str = "arm1") -> JoinedArm:
        return self._arms[name]

    # -- the world ---------------------------------------------------------------------------------------------------

    def ask(self, request: Message) -> WorldReply:
        """One of the requests of ``rackhand.schemas.world``; ``Advance`` returns when the world is there."""
        reply = self.session.handle(WorldRequest(request=request))  # type: ignore[arg-type]
        if isinstance(request, Reset):
            self._begin()
        self.session.take_changes()
        if reply is None:
            self._run()
            reply = self.session.reply()
        return reply

    def ask_lift(self, request: Message, name: str = "lift_1") -> LiftState:
        """One of the requests of ``rackhand.schemas.lift``. Raises ``RequestRefused``."""
        asked = LiftRequest(request=request)  # type: ignore[arg-type]
        return self.simulation.lifts[name].handle(asked, self.simulation.stamp)

    def inspect(self) -> WorldReply:
        return self.ask(Inspect())

    def pause(self) -> WorldReply:
        return self.ask(Pause(paused=True))

    def advance(self, seconds: float) -> WorldReply:
        """Let so much simulation time pass."""
        return self.ask(Advance(duration_ns=round(seconds * NANOSECONDS)))

    def now(self) -> float:
        """Simulation time in seconds."""
        return self.simulation.stamp / NANOSECONDS

    def wait_for(self, found: Callable[[], T | None], what: str, within: float = 240.0, step: float = 0.2) -> T:
        """Let time pass until ``found()`` is something; at most ``within`` seconds of simulation time."""
        end = self.simulation.stamp + round(within * NANOSECONDS)
        while (value := found()) is None:
            assert self.simulation.stamp < end, f"{within:g} s of simulation time passed before {what}"
            self.advance(step)
        return value

    # -- ground truth ------------------------------------------------------------------------------------------------

    def objects(self) -> dict[str, ObjectPose]:
        return {thing.name: thing for thing in self.simulation.objects().objects}

    def true_poses(self) -> dict[str, Pose2]:
        return {name: planar(thing) for name, thing in self.objects().items()}

    def true_pose(self, name: str) -> Pose2:
        return self.true_poses()[name]

    # -- time --------------------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        """A run of the world begins: every core joins it, as its service would."""
        for core in self._cores():
            core.begin()
            join = Join(robot=core.name, service=core.service, period_ns=core.period_ns)
            self.session.handle(WorldRequest(request=join))
        self.session.take_changes()
        self._deliver(self.simulation.outputs)

    def _run(self) -> None:
        pacer = self.session.pacer
        while True:
            decision = pacer.decide(self.simulation.stamp, math.inf)
            if pacer.until is None:
                return
            missing = pacer.missing(self.simulation.stamp)
            assert decision.kind == "step", f"simulation waits for {missing or decision.kind} at {self.now():.3f} s"
            self.session.step()
            self._deliver(self.simulation.outputs)

    def _deliver(self, outputs: tuple[Output, ...]) -> None:
        for core in self._cores():
            core.on_clock(self.session.clock)
        for output in outputs:
            for core in self._cores():
                if output.robot == core.name:
                    core.on_message(output.topic, output.message)

    def _cores(self) -> Iterable[JoinedChassis | JoinedArm]:
        return [*self._arms.values(), *self._chassis.values()]
