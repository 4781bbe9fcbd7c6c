"""A hardware driver in miniature: a chassis with perfect wheels in an empty square hall, in real time, without physics.

It uses nothing but the public contract (``rackhand.bus``, ``rackhand.schemas``). Put your motor controller in place of
``Wheels`` and your lidar in place of ``hall_scan``; a real robot also gets its pose from a localiser.

    rackhand up --world empty --no-sim &                  # router, planner, gateway: all but the robot
    python examples/09_hardware_driver.py --robot amr1 &
    curl -X POST http://127.0.0.1:8090/chassis/moves -H 'Content-Type: application/json' \\
         -d '{"creator": "me", "type": "standard", "target_x": 3, "target_y": 2, "target_ori": 0}'
"""

from __future__ import annotations

import argparse
import math
import time
import uuid

import numpy as np

from rackhand.bus import Bus
from rackhand.bus.log import configure_logging
from rackhand.schemas import chassis, topics
from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.service import DRIVER, WORLD, ServiceId
from rackhand.schemas.world import Clock

STEP_NS = 20_000_000  # odometry at 50 Hz, as its row in the topic table says
COMMAND_LIFE_NS = 100_000_000  # a command that answers older odometry than this is stale: the wheels stop
HALL = 10.0  # m from the middle of the hall of world `empty` to each of its walls
AT_REST = Twist2(linear=0.0, angular=0.0)
LIDAR = chassis.LidarModel(
    pose=Pose2(x=0.2, y=0.0, yaw=0.0), height=0.18, beams=360, view=2 * math.pi, rate=12.5, range_max=30.0, noise=0.0
)
MODEL = chassis.ChassisModel(
    name="skeleton",
    footprint=np.array([[0.375, 0.23], [-0.375, 0.23], [-0.375, -0.23], [0.375, -0.23]]),
    height=0.25,
    wheel_separation=0.38,
    wheel_radius=0.075,
    limits=chassis.ChassisLimits(
        forward=1.0, reverse=0.2, angular=1.0, acceleration=0.5, deceleration=1.5, angular_acceleration=1.5
    ),
    actuation=chassis.Actuation(latency=0.02, lag=0.02),
    lidar=LIDAR,
)


class Wheels:
    """They turn exactly as commanded, and stop when commands grow stale. Stamps in ns, poses in metres and radians."""

    def __init__(self) -> None:
        self.stamp = 0
        self.pose = Pose2(x=0.0, y=0.0, yaw=0.0)
        self.twist = AT_REST
        self._command: chassis.ChassisCommand | None = None

    def take(self, _robot: str, command: chassis.ChassisCommand) -> None:
        if command.answers <= self.stamp:  # one from the future belongs to a former run of this driver
            self._command = command

    def step(self) -> None:
        self.stamp += STEP_NS
        command = self._command
        fresh = command is not None and self.stamp - command.answers <= COMMAND_LIFE_NS
        self.twist = command.twist if command is not None and fresh else AT_REST
        dt, (x, y, yaw) = STEP_NS * 1e-9, (self.pose.x, self.pose.y, self.pose.yaw)
        middle = yaw + self.twist.angular * dt / 2
        x, y = x + self.twist.linear * dt * math.cos(middle), y + self.twist.linear * dt * math.sin(middle)
        self.pose = Pose2(x=x, y=y, yaw=math.remainder(yaw + self.twist.angular * dt, math.tau))

    def odometry(self) -> chassis.Odometry:
        half = self.twist.angular * MODEL.wheel_separation / 2
        speeds = ((self.twist.linear - half) / MODEL.wheel_radius, (self.twist.linear + half) / MODEL.wheel_radius)
        return chassis.Odometry(stamp=self.stamp, pose=self.pose, twist=self.twist, wheel_velocities=speeds)


def hall_scan(stamp: int, pose: Pose2) -> chassis.Scan:
    """Distances from the lidar to the four walls of the empty hall."""
    step, first = LIDAR.view / LIDAR.beams, -LIDAR.view / 2
    angles = first + step * np.arange(LIDAR.beams) + pose.yaw
    x, y = pose.x + LIDAR.pose.x * math.cos(pose.yaw), pose.y + LIDAR.pose.x * math.sin(pose.yaw)
    with np.errstate(divide="ignore"):
        to_x = (np.copysign(HALL, np.cos(angles)) - x) / np.cos(angles)
        to_y = (np.copysign(HALL, np.sin(angles)) - y) / np.sin(angles)
    ranges = np.minimum(to_x, to_y).astype(np.float32)
    return chassis.Scan(
        stamp=stamp, sensor=LIDAR.pose, angle_min=first, angle_step=step, range_max=LIDAR.range_max, ranges=ranges
    )


class Driver:
    """Publishes what the chassis measures, each topic at its rate, and odometry last of those with one stamp."""

    def __init__(self, bus: Bus, robot: str) -> None:
        self.wheels, self._steps = Wheels(), 0
        self.inbox = bus.inbox().on(topics.COMMAND, self.wheels.take, robot)
        self._odometry, self._scan = bus.publisher(topics.ODOMETRY, robot), bus.publisher(topics.SCAN, robot)
        self._pose, self._contacts = bus.publisher(topics.POSE, robot), bus.publisher(topics.CONTACTS, robot)
        self._battery, self._clock = bus.publisher(topics.BATTERY, robot), bus.publisher(topics.CLOCK, WORLD)
        self._model = bus.publisher(topics.CHASSIS_MODEL, robot)
        self._model.put(MODEL)
        self._run, self._born = uuid.uuid4().hex[:12], time.time_ns()

    def step(self) -> None:
        self.wheels.step()
        self._steps += 1
        stamp, pose = self.wheels.stamp, self.wheels.pose
        if self._steps % 4 == 0:
            self._scan.put(hall_scan(stamp, pose))
        if self._steps % 2 == 0:
            self._pose.put(chassis.LocalisedPose(stamp=stamp, pose=pose, covariance=np.eye(3) * 1e-6, quality=10))
        if self._steps % 5 == 0:
            self._contacts.put(chassis.Contacts(stamp=stamp))
        if self._steps % 50 == 0:
            self._battery.put(chassis.Battery(stamp=stamp, percentage=0.9, voltage=26.0, current=1.0, charging=False))
        self._odometry.put(self.wheels.odometry())
        self._clock.put(
            Clock(
                stamp=stamp, run=self._run, step_ns=STEP_NS, speed=1.0, paused=False, lockstep=False, unix_ns=self._born
            )
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="amr1", help="name of the chassis on the bus (%(default)s)")
    robot = parser.parse_args().robot
    configure_logging("driver")
    with Bus(ServiceId(DRIVER, robot)) as bus:  # its liveliness token is rackhand/<robot>/alive/driver
        bus.handle_signals()
        driver = Driver(bus, robot)
        bus.announce()
        due = time.monotonic()
        while not bus.stopping:
            event = driver.inbox.get(timeout=max(0.0, due - time.monotonic()))
            if event is not None:
                driver.inbox.dispatch(event)
            elif time.monotonic() >= due:
                driver.step()
                due = max(due + STEP_NS * 1e-9, time.monotonic() - 0.1)  # catches up a little


if __name__ == "__main__":
    main()
