"""One chassis at run time: commands, wheels, jack, sensors."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import (
    Battery,
    ChassisCommand,
    ChassisModel,
    Contacts,
    Imu,
    Jack,
    LocalisedPose,
    Odometry,
    Scan,
)
from rackhand.schemas.planar import wrap, yaw_quaternion
from rackhand.services.sim.chassis import drive
from rackhand.services.sim.chassis.battery import BatteryModel
from rackhand.services.sim.chassis.drive import WheelTargets
from rackhand.services.sim.chassis.lidar import Lidar
from rackhand.services.sim.chassis.noise import NoiseSettings, PoseNoise, generator
from rackhand.services.sim.chassis.odometer import Odometer
from rackhand.services.sim.mjcf.chassis_model import WHEELS
from rackhand.worlds.chassis_model import ChassisProfile
from rackhand.worlds.data import PoseTuple

GRAVITY = 9.81
POSE_PERIOD = 0.04
QUALITY_EXCELLENT = 10
LOADED = 5.0  # kg on the jack from which on its driver brakes with care


class Robot:
    """A chassis of one model and data. ``dock_poses``: where contacts at a chassis' back meet a charger's."""

    def __init__(
        self,
        name: str,
        profile: ChassisProfile,
        model: Any,
        data: Any,
        seed: int,
        noise: NoiseSettings,
        battery: float,
        dock_poses: tuple[PoseTuple, ...],
    ) -> None:
        self.name, self.profile = name, profile
        self.faults: dict[str, float] = {}
        """Those that it has → how much of each."""
        self.command: ChassisCommand | None = None
        self._admitted = -1
        self.body = int(model.body(name).id)
        self.hull = int(model.geom(f"{name}/hull").id)
        self._model, self._data = model, data
        self.dock_poses = dock_poses
        self._find_addresses()
        self._targets = WheelTargets(0.0, 0.0)
        self._spindle = 0.0
        self._jacking = 0
        self._stalled = False
        self._bumped = {"front": False, "rear": False}
        self.battery = BatteryModel(profile.battery, battery)
        self._noise = noise
        self._odometer = Odometer(profile.drive, noise, generator(seed, name, "encoders"), self._wheel_angles())
        self._pose_noise = PoseNoise(noise, generator(seed, name, "pose"), POSE_PERIOD)
        self._imu_rng = generator(seed, name, "imu")
        self._gyro_bias = noise.scale * noise.gyro_bias * self._imu_rng.standard_normal(3)
        self._weight_rng = generator(seed, name, "jack")
        self._lidar = Lidar(profile.lidar, self.body, generator(seed, name, "lidar"), noise.scale)

    def _find_addresses(self) -> None:
        model, name = self._model, self.name
        free = model.joint(f"{name}/free")
        self.qpos, self._qvel = int(free.qposadr[0]), int(free.dofadr[0])
        wheels = [model.joint(f"{name}/{part}") for part in WHEELS]
        self._wheel_qpos = [int(w.qposadr[0]) for w in wheels]
        self._wheel_dofs = [int(w.dofadr[0]) for w in wheels]
        self._wheel_motors = [int(model.actuator(f"{name}/{part}").id) for part in WHEELS]
        self._jack_motor = int(model.actuator(f"{name}/jack").id) if self.profile.jack else None
        self._gyro, self._accelerometer = (
            int(model.sensor(f"{name}/{kind}").adr[0]) for kind in ("gyro", "accelerometer")
        )

    # -- truth -------------------------------------------------------------------------------------------------------

    @property
    def pose(self) -> PoseTuple:
        """Ground-truth pose in the map."""
        x, y, _, w, qx, qy, z = self._data.qpos[self.qpos : self.qpos + 7]
        return float(x), float(y), math.atan2(2 * (w * z + qx * qy), 1 - 2 * (qy * qy + z * z))

    @property
    def driver_gone(self) -> bool:
        """Nobody measures for it or drives it."""
        return "driver_gone" in self.faults

    @property
    def charge_contact(self) -> bool:
        """Its contacts meet a charger's: within 2 cm and 3° of a dock pose, turned round if they are at the front."""
        if self.profile.charge_contact == "none" or "no_charge_contact" in self.faults:
            return False
        x, y, yaw = self.pose
        if self.profile.charge_contact == "front":
            yaw += math.pi
        return any(
            math.hypot(x - dx, y - dy) < 0.02 and abs(wrap(yaw - dyaw)) < math.radians(3)
            for dx, dy, dyaw in self.dock_poses
        )

    @property
    def charging(self) -> bool:
        docked = self.charge_contact and "no_charge_current" not in self.faults
        return docked or "power_cable" in self.faults

    def admit(self, command: ChassisCommand) -> bool:
        """False if the command answers an older stamp than one that was admitted before, or the driver is gone."""
        if command.answers < self._admitted or self.driver_gone:
            return False
        self._admitted = command.answers
        return True

    def put(self, pose: PoseTuple) -> None:
        """Be at ``pose``, without more. Its odometry knows nothing of it."""
        x, y, yaw = pose
        self._data.qpos[self.qpos : self.qpos + 2] = (x, y)
        self._data.qpos[self.qpos + 3 : self.qpos + 7] = yaw_quaternion(yaw)

    def rest(self, controls: NDArray[np.float64]) -> None:
        """Stop at once, as after the robot was moved to another pose. ``controls``: of the current control step."""
        controls[:, self._wheel_motors] = 0
        qvel = self._data.qvel
        qvel[self._qvel : self._qvel + 6] = 0
        qvel[self._wheel_dofs] = 0
        self._targets = WheelTargets(0.0, 0.0)

    # -- driving -----------------------------------------------------------------------------------------------------

    def drive(self, controls: NDArray[np.float64], stamp: int, dt: float) -> None:
        """Fill the robot's columns of ``controls`` (steps × actuators) for ``dt`` seconds from ``stamp`` on."""
        command = self.command if drive.is_fresh(self.command, stamp) else None
        stopped = "emergency_stop_button" in self.faults
        blocked = "wheels_blocked" in self.faults
        before = self._targets
        if command is None or stopped or blocked:
            self._targets = drive.brake(before, self.profile.drive, self._is_loaded(), dt)
        else:
            self._targets = drive.follow(before, command.twist, self.profile.drive, dt)
        part = np.arange(1, len(controls) + 1) / len(controls)
        for motor, old, new in zip(
            self._wheel_motors, (before.left, before.right), (self._targets.left, self._targets.right), strict=True
        ):
            controls[:, motor] = (old + part * (new - old)) / self.profile.drive.wheel_radius
        self._drive_jack(controls, part, "hold" if command is None or stopped else command.jack, dt)
        self.battery.draw((self._targets.left + self._targets.right) / 2, self._jacking != 0, self.charging, dt)

    def _drive_jack(self, controls: NDArray[np.float64], part: NDArray[np.float64], wanted: str, dt: float) -> None:
        jack = self.profile.jack
        if jack is None or self._jack_motor is None:
            return
        direction = {"up": 1, "down": -1, "hold": 0}[wanted]
        before = self._spindle
        self._stalled = direction > 0 and before < jack.stroke and self._jack_force() > jack.force
        if self._stalled:
            direction = 0
        self._spindle = min(jack.stroke, max(0.0, before + direction * jack.stroke / jack.duration * dt))
        self._jacking = direction if self._spindle != before else 0
        controls[:, self._jack_motor] = before + part * (self._spindle - before)

    def bump(self, contact: Any) -> None:
        """Its body touches something there: the bumper of that side stays closed until it is reported."""
        rotation = self._data.xmat[self.body].reshape(3, 3)
        ahead = float((np.asarray(contact.pos) - self._data.xpos[self.body]) @ rotation[:, 0])
        self._bumped["front" if ahead >= self.profile.body.centre[0] else "rear"] = True

    # -- sensors: each is called once for each of its publications ---------------------------------------------------

    def odometry(self, stamp: int, dt: float) -> Odometry:
        return self._odometer.measure(self._wheel_angles(), stamp, dt)

    def imu(self, stamp: int) -> Imu:
        noise = self._imu_rng.standard_normal(6) * self._noise.scale
        measured = self._data.sensordata
        tilt = rolled(self.faults.get("tilted", 0.0))
        turning = tilt @ measured[self._gyro : self._gyro + 3] + self._gyro_bias + self._noise.gyro * noise[:3]
        force = tilt @ measured[self._accelerometer : self._accelerometer + 3] + self._noise.accelerometer * noise[3:]
        return Imu(stamp=stamp, angular_velocity=tuple(turning.tolist()), linear_acceleration=tuple(force.tolist()))

    def scan(self, stamp: int) -> Scan:
        more_noise = self.faults.get("lidar_noisy", 0.0)
        return self._lidar.scan(self._model, self._data, stamp, "lidar_blind" in self.faults, more_noise)

    def localised_pose(self, stamp: int) -> LocalisedPose:
        """Truth and seeded noise, standing where a localiser will."""
        error = self._pose_noise.draw()
        x, y, yaw = self.pose
        return LocalisedPose(
            stamp=stamp,
            pose=Pose2(x=x + float(error[0]), y=y + float(error[1]), yaw=wrap(yaw + float(error[2]))),
            covariance=np.diag(self._pose_noise.sigma**2),
            quality=QUALITY_EXCELLENT,
        )

    def jack(self, stamp: int) -> Jack:
        """Progress is the spindle's. The weight is what the servo bears beyond its own plate, to half a kilogram.

        Raises ``LookupError`` for a chassis without a jack.
        """
        kind = self.profile.jack
        if kind is None or self._jack_motor is None:
            raise LookupError(f"{self.name} has no jack")
        borne = self._jack_force() / GRAVITY - kind.mass
        weight = max(0.0, borne + 0.5 * self._noise.scale * float(self._weight_rng.standard_normal()))
        states = {0: "hold", 1: "jacking_up", -1: "jacking_down"}
        return Jack.model_validate(
            {
                "stamp": stamp,
                "state": states[self._jacking],
                "progress": self._spindle / kind.stroke,
                "weight": weight,
                "stalled": self._stalled,
            }
        )

    def _jack_force(self) -> float:
        """What the spindle bears, plate included (N)."""
        return float(self._data.actuator_force[self._jack_motor])

    def _is_loaded(self) -> bool:
        jack = self.profile.jack
        return jack is not None and self._jack_force() > (jack.mass + LOADED) * GRAVITY

    def battery_report(self, stamp: int) -> Battery:
        return self.battery.report(stamp, self.charging)

    def contacts(self, stamp: int) -> Contacts:
        bumped, self._bumped = self._bumped, {"front": False, "rear": False}
        return Contacts(
            stamp=stamp,
            bumper_front=bumped["front"],
            bumper_rear=bumped["rear"],
            charge_contact=self.charge_contact,
            power_cable="power_cable" in self.faults,
            emergency_stop_button="emergency_stop_button" in self.faults,
        )

    def set_friction(self, friction: float | None) -> None:
        """Of the wheels on the floor; None is that of the profile."""
        value = self.profile.drive.friction if friction is None else friction
        for part in WHEELS:
            self._model.geom_friction[int(self._model.geom(f"{self.name}/{part}").id), 0] = value

    def chassis_model(self) -> ChassisModel:
        return self.profile.describe()

    def _wheel_angles(self) -> tuple[float, float]:
        left, right = (float(self._data.qpos[address]) for address in self._wheel_qpos)
        return left, right


def rolled(angle: float) -> NDArray[np.float64]:
    """The matrix (3 × 3) from the frame of a body to that of the same body turned by ``angle`` about its x axis."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])
