"""The simulated world at run time: requests that change it, control steps, and the measurements due at each."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import mujoco
import numpy as np

from rackhand.schemas import topics
from rackhand.schemas.chassis import ChassisCommand, LocalisedPose, Odometry, Scan
from rackhand.schemas.motion import ArmCommand, ArmModel
from rackhand.schemas.refusal import RequestRefused
from rackhand.schemas.service import WORLD
from rackhand.schemas.topics import Topic
from rackhand.schemas.world import Change, ObjectPose, Objects, Scene
from rackhand.services.sim import physics
from rackhand.services.sim.actors.movables import Movables
from rackhand.services.sim.actors.obstacles import Obstacles
from rackhand.services.sim.actors.walkers import Walker, is_in_way, make_route
from rackhand.services.sim.arm.arm import Arm
from rackhand.services.sim.chassis.noise import NoiseSettings
from rackhand.services.sim.chassis.robot import Robot
from rackhand.services.sim.errors import PhysicsError
from rackhand.services.sim.lift.cabin import Lift
from rackhand.services.sim.mjcf.scene import build_model
from rackhand.services.sim.physics import Physics
from rackhand.services.sim.world import scenery
from rackhand.services.sim.world.contact_log import ContactLog
from rackhand.services.sim.world.editor import Editor
from rackhand.services.sim.world.things import Things
from rackhand.services.sim.world.touch_log import TouchLog
from rackhand.worlds.arm_model import load_arm_descriptions
from rackhand.worlds.chassis_model import ChassisProfile
from rackhand.worlds.data import PoseTuple, WorldFileError
from rackhand.worlds.world_model import CONTROL_STEP_NS, Mover, Walk, World

SETTLING_STEPS = 15
NOISE = NoiseSettings()
_FATAL_WARNINGS = (
    mujoco.mjtWarning.mjWARN_BADQPOS,
    mujoco.mjtWarning.mjWARN_BADQVEL,
    mujoco.mjtWarning.mjWARN_BADQACC,
)


@dataclass(frozen=True)
class Output:
    """A message to publish: on this topic, as that of this robot (or of the world)."""

    topic: Topic[Any]
    robot: str
    message: Any


class Simulation:
    """A world from stamp 0 on. A reset builds another one: the same seed gives the same bytes.

    ``step`` takes one control step (20 ms; 2 ms where there are arms); ``outputs`` is what is due after it, in the
    order of the contract, and stays the same until the next step, so that it can be published again.
    """

    def __init__(
        self, world: World, profiles: Mapping[str, ChassisProfile], seed: int, noise: NoiseSettings = NOISE
    ) -> None:
        self.world, self.seed = world, seed
        self.control_step_ns = world.control_step_ns
        kinds = load_arm_descriptions(world)
        self.model = build_model(world, profiles, kinds)
        self.data = mujoco.MjData(self.model)
        self.obstacles = Obstacles(self.model, self.data)
        self._steps = round(self.control_step_ns * 1e-9 / world.timestep)
        self._controls = np.zeros((round(CONTROL_STEP_NS * 1e-9 / world.timestep), self.model.nu))
        self.arms = {
            name: Arm(name, kind, world.arms[name].home or kind.home, self.model, self.data)
            for name, kind in kinds.items()
        }
        self._ctrl, self._qpos, self._qvel = self.data.ctrl, self.data.qpos, self.data.qvel
        servos = [arm.compiled_servo for arm in self.arms.values()]
        self._physics = Physics(self.model, self.data, servos) if servos and physics.is_available() else None
        self._segments_ended = True
        self._settle()
        docks = tuple(charger.dock for charger in world.chargers.values())
        self.robots = {
            name: Robot(name, profile, self.model, self.data, seed, noise, world.robots[name].battery, docks)
            for name, profile in profiles.items()
        }
        compounds = {*self.arms, *world.lifts}
        self._geom_names = scenery.owners(self.model, compounds)
        self._bodies = scenery.moving_bodies(self.model)
        hulls = {robot.hull: name for name, robot in self.robots.items()}
        hulls |= {int(geom): name for name, arm in self.arms.items() for geom in arm.geoms}
        self.contact_log = ContactLog(hulls, self.model.ngeom, self._owner)
        self.touch_log = TouchLog(scenery.parts(self.model, compounds, self.robots))
        self._movables = Movables(world, self.model, self.data)
        self.lifts = {
            name: Lift(name, world, self.model, self.data, self.robots, self.obstacles, self._movables, seed)
            for name in world.lifts
        }
        things = Things(self.robots, self.arms, self.lifts, self.obstacles, self._movables)
        self._editor = Editor(world, self.model, self.data, things, self._owner, self._controls, self.touch_log)
        self.stamp = 0
        self._hash = hashlib.blake2b(digest_size=16)
        try:
            self._populate()
        except (RequestRefused, ValueError) as error:
            raise WorldFileError(f"world {world.name}: {error}") from None
        self._finish_step()

    @property
    def digest(self) -> str:
        """A hash over all control steps so far: their stamps, states (qpos, qvel, act, poses of actors), scans,
        odometry, localised poses and arm states.
        """
        return self._hash.copy().hexdigest()

    @property
    def outputs(self) -> tuple[Output, ...]:
        """All that is due at the present control step, in the order of the contract."""
        return self.outputs_with(self.arms)

    def outputs_with(self, arms: Iterable[str]) -> tuple[Output, ...]:
        """What is due now, with the states of these arms only. Odometry is the last of its robot, and of the step."""
        return (*self._before, *(self._arm_output(name) for name in arms), *self._after)

    def _arm_output(self, name: str) -> Output:
        """Made when it is asked for: not all states of an arm are published."""
        if name not in self._arm_states:
            self._arm_states[name] = Output(topics.ARM_STATE, name, self.arms[name].state(self.stamp))
        return self._arm_states[name]

    # -- commands and requests ---------------------------------------------------------------------------------------

    def command(self, robot: str, command: ChassisCommand | ArmCommand) -> bool:
        """Take a command and let it take effect at once. False if ``admit`` refuses it."""
        if not self.admit(robot, command):
            return False
        self.apply(robot, command)
        return True

    def admit(self, robot: str, command: ChassisCommand | ArmCommand) -> bool:
        """Whether a command may take effect, now or later. False if it is not of this run (it answers a stamp of the
        future), malformed, older than one that was admitted before, or of a grant that a newer one replaced.
        """
        if command.answers > self.stamp:
            return False
        if isinstance(command, ArmCommand):
            return robot in self.arms and self.arms[robot].admit(command)
        return robot in self.robots and self.robots[robot].admit(command)

    def apply(self, robot: str, command: ChassisCommand | ArmCommand) -> None:
        """Let an admitted command take effect from the next control step on."""
        if isinstance(command, ArmCommand):
            self.arms[robot].command(command)
        else:
            self.robots[robot].command = command

    def silence(self, robot: str) -> None:
        """The robot has no commander any more: it brakes at once, before its last command becomes stale."""
        if robot in self.robots:
            self.robots[robot].command = None
        if robot in self.arms:
            self.arms[robot].silence()

    def change(self, change: Change) -> None:
        """Change what is in the world. Raises ``RequestRefused``, and has then changed nothing."""
        self._editor.change(change, self.stamp)

    def arm_model(self, name: str) -> ArmModel:
        """Which arm it is, and where its base frame is."""
        base = self.data.body(f"{name}/{self.arms[name].kind.base}")
        return ArmModel(
            kind=self.world.arms[name].kind,
            position=tuple(base.xpos.tolist()),
            orientation=tuple(base.xquat.tolist()),
        )

    def scene(self) -> Scene:
        """The geometry of all that is there now."""
        return scenery.scene(self.model, self.stamp, self.obstacles)

    # -- time --------------------------------------------------------------------------------------------------------

    def step(self) -> None:
        """Take one control step with the commands that are in force."""
        into = self.stamp % CONTROL_STEP_NS
        if into == 0:
            self._begin_chassis_step()
        for arm in self.arms.values():
            arm.begin(self.stamp)
        first = into // self.control_step_ns * self._steps
        self._run(self._controls[first : first + self._steps])
        self._movables.end_hits()
        self.stamp += self.control_step_ns
        self._check_physics()
        self._finish_step()

    def _begin_chassis_step(self) -> None:
        """What the chassis' drives and lifts do, and where people go, in the next 20 ms."""
        dt = CONTROL_STEP_NS * 1e-9
        for robot in self.robots.values():
            robot.drive(self._controls, self.stamp, dt)
        for lift in self.lifts.values():
            lift.drive(self._controls, self.stamp, dt)
        self._move_walkers(dt)

    def _run(self, controls: np.ndarray[Any, Any]) -> None:
        """Physics step by physics step, so that no contact is too short for the log."""
        step = self._physics_step()
        stamp, step_ns = self.stamp, round(self.world.timestep * 1e9)
        for row in controls:
            self._ctrl[:] = row
            step()
            self.touch_log.observe(self.data, stamp)
            if self.contact_log.touches(self.data):
                for name, index in self.contact_log.observe(self.model, self.data, stamp):
                    if name in self.robots:
                        self.robots[name].bump(self.data.contact[index])
            stamp += step_ns

    def _physics_step(self) -> Callable[[], None]:
        """The fastest way to take the physics steps of this control step."""
        if not self.arms:
            return partial(mujoco.mj_step, self.model, self.data)
        if self._physics is None or not all(arm.only_follows for arm in self.arms.values()):
            return self._step_with_servos
        return self._step_compiled

    def _step_compiled(self) -> None:
        assert self._physics is not None
        if self._segments_ended:
            for arm in self.arms.values():
                arm.continue_reference()
        self._segments_ended = self._physics.step()

    def _step_with_servos(self) -> None:
        """The servos of arms run in the middle of a step, where the forces to be compensated are known."""
        self._segments_ended = True  # they may have, at the next step
        mujoco.mj_step1(self.model, self.data)
        for arm in self.arms.values():
            arm.servo()
        mujoco.mj_step2(self.model, self.data)

    def _settle(self) -> None:
        """Let the wheels take the weight before time begins. Racks sleep meanwhile."""
        step = self._physics_step()
        for _ in range(SETTLING_STEPS * len(self._controls)):
            step()
        self.data.time = 0.0

    def _check_physics(self) -> None:
        """MuJoCo meets a state that is not finite by starting over at time 0, silently: such a run must end."""
        if self.data.time > (self.stamp - self.control_step_ns / 2) * 1e-9:
            return
        counts = self.data.warning.number
        found = ", ".join(warning.name for warning in _FATAL_WARNINGS if counts[warning])
        raise PhysicsError(f"the physics became unstable at stamp {self.stamp}: {found}")

    def _finish_step(self) -> None:
        """Measure what is due, and add the state and all measurements to the digest."""
        update = self._hash.update
        update(self.stamp.to_bytes(8, "little"))
        update(self._qpos)
        update(self._qvel)
        self._arm_states: dict[str, Output] = {}
        before: list[Output] = []
        after: list[Output] = []
        if self.stamp % CONTROL_STEP_NS == 0:
            self._kinematics()
            for part in (self.data.act, self.data.mocap_pos, self.data.mocap_quat):
                update(part)
            before, after = self._measure_chassis()
        for output in before:
            update(_measured(output.message))
        for arm in self.arms.values():
            for values in arm.measured():
                update(values.data)
        for output in after:
            update(_measured(output.message))
        self._before, self._after = before, after

    def _kinematics(self) -> None:
        """Frames of what is now: a step leaves those of its beginning."""
        mujoco.mj_kinematics(self.model, self.data)

    # -- measurements ------------------------------------------------------------------------------------------------

    def _measure_chassis(self) -> tuple[list[Output], list[Output]]:
        """What is due now: all but odometry, and odometry."""
        stamp, outputs = self.stamp, []
        dt = CONTROL_STEP_NS * 1e-9 if stamp else 0.0
        for name, robot in self.robots.items():
            outputs.append(Output(topics.IMU, name, robot.imu(stamp)))
            if stamp % robot.profile.lidar.period_ns == 0:
                scan = robot.scan(stamp)
                if "lidar_dead" not in robot.faults:
                    outputs.append(Output(topics.SCAN, name, scan))
            if _is_due(topics.POSE, stamp):
                pose = robot.localised_pose(stamp)
                if "pose_lost" not in robot.faults:
                    outputs.append(Output(topics.POSE, name, pose))
            if robot.profile.jack is not None and _is_due(topics.JACK, stamp):
                outputs.append(Output(topics.JACK, name, robot.jack(stamp)))
            if _is_due(topics.BATTERY, stamp):
                outputs.append(Output(topics.BATTERY, name, robot.battery_report(stamp)))
            if _is_due(topics.CONTACTS, stamp):
                outputs.append(Output(topics.CONTACTS, name, robot.contacts(stamp)))
        if _is_due(topics.LIFT_STATE, stamp):
            outputs += [Output(topics.LIFT_STATE, name, lift.state(stamp)) for name, lift in self.lifts.items()]
        if _is_due(topics.OBJECTS, stamp):
            outputs.append(Output(topics.OBJECTS, WORLD, self.objects()))
        odometry = [Output(topics.ODOMETRY, name, robot.odometry(stamp, dt)) for name, robot in self.robots.items()]
        return outputs, odometry

    def objects(self) -> Objects:
        """True poses of all that can move."""
        bodies = self._bodies | {name: self.obstacles.body_of(placed) for name, placed in self.obstacles.placed.items()}
        positions, quaternions = self.data.xpos, self.data.xquat
        return Objects(
            stamp=self.stamp,
            objects=tuple(
                ObjectPose(
                    name=name, position=tuple(positions[body].tolist()), orientation=tuple(quaternions[body].tolist())
                )
                for name, body in bodies.items()
                if name not in self._movables or not self._movables.is_away(name)
            ),
        )

    # -- people and things -------------------------------------------------------------------------------------------

    def _populate(self) -> None:
        for name, mover in self.world.movers.items():
            pose, walker = _start_of(mover)
            self._begin_with(name, "person", (mover.radius, mover.height), pose, walker)
        for name, obstacle in self.world.obstacles.items():
            self._begin_with(name, obstacle.kind, obstacle.size, obstacle.pose, None)
        self._kinematics()
        for name, robot in self.robots.items():
            try:
                self._editor.check_robot(robot, robot.pose)
            except RequestRefused as refused:
                raise RequestRefused(refused.code, f"robots.{name}.pose: {refused.text}") from None

    def _begin_with(
        self, name: str, kind: str, size: tuple[float, ...], pose: PoseTuple, walker: Walker | None
    ) -> None:
        placed = self.obstacles.place(name, kind, size, pose, walker)
        self.touch_log.relabel(self.obstacles.geom_of(placed), name)

    def _move_walkers(self, dt: float) -> None:
        robots = [(r.pose, r.profile.body.size[0] / 2, r.profile.body.size[1] / 2) for r in self.robots.values()]
        for name, placed in list(self.obstacles.placed.items()):
            walker = placed.walker
            if walker is None or any(is_in_way(walker.pose, placed.radius, *robot) for robot in robots):
                continue
            walker = walker.after(dt)
            self.obstacles.placed[name] = replace(placed, walker=walker, pose=walker.pose)
            self.obstacles.move(placed, walker.pose)

    def _owner(self, geom: int) -> str:
        """The name of the thing a geom belongs to."""
        return self.obstacles.names_by_geom().get(geom) or self._geom_names[geom]


def _is_due(topic: Topic[Any], stamp: int) -> bool:
    """Whether the stamp is a multiple of the topic's period."""
    return stamp % _period(topic.rate) == 0


@cache
def _period(rate: float) -> int:
    return round(1e9 / rate)


def _measured(message: Any) -> bytes:
    """The numbers of a measurement that a planner steers by."""
    match message:
        case Scan():
            return message.ranges.tobytes()
        case Odometry() | LocalisedPose():
            return np.array([message.pose.x, message.pose.y, message.pose.yaw]).tobytes()
        case _:
            return b""


def _start_of(mover: Mover) -> tuple[PoseTuple, Walker | None]:
    if isinstance(mover.motion, Walk):
        walker = Walker(make_route(mover.motion.points, mover.motion.speed, mover.motion.wait))
        return walker.pose, walker
    return mover.motion.pose, None
