"""A small 2-D plant to test navigation on: exact body against polygons, lagging wheels, noisy pose, ray-cast scans.

Independent of the code under test: own geometry, own integration.
"""

from __future__ import annotations

import io
import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import LocalisedPose, Odometry, Scan
from rackhand.schemas.maps import MapData
from rackhand.schemas.moves import MoveCreate
from rackhand.services.planner.behaviors.base import Done, Drive
from rackhand.services.planner.behaviors.registry import BEHAVIORS, Registry
from rackhand.services.planner.motion import Motion
from rackhand.services.planner.perception.chassis_state import ChassisState, Observation
from rackhand.services.planner.perception.local_costmap import LocalCostmap
from rackhand.services.planner.planning.goals import Goal
from rackhand.services.planner.settings import NavigationSettings
from tests.chassis_models import chassis_model

Array = NDArray[np.float64]
TICK = 40_000_000
SUBSTEP = 0.01
BEAMS = 720
BODY = np.array([(0.375, 0.23), (-0.375, 0.23), (-0.375, -0.23), (0.375, -0.23)])
RESOLUTION = 0.05
_EXECUTOR = ThreadPoolExecutor(1, thread_name_prefix="plan")


def box(x: float, y: float, width: float, depth: float, yaw: float = 0.0) -> Array:
    """A rectangle's corners, counter-clockwise, about its centre."""
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * (width / 2, depth / 2)
    c, s = math.cos(yaw), math.sin(yaw)
    return corners @ np.array([(c, s), (-s, c)]) + (x, y)


@dataclass
class Walker:
    """A person: a disc that walks its waypoints in a loop. ``polite`` ones stop in front of the robot."""

    points: Array
    speed: float = 1.0
    radius: float = 0.25
    polite: bool = False
    position: Array = field(default_factory=lambda: np.zeros(2))
    heading: int = 1

    def __post_init__(self) -> None:
        self.points = np.asarray(self.points, dtype=float)
        self.position = self.points[0].copy()

    def step(self, dt: float, robot: Array) -> None:
        way = self.points[self.heading] - self.position
        left = float(np.hypot(*way))
        if self.polite and left > 0:
            to_robot = robot[:2] - self.position
            if np.hypot(*to_robot) < 0.9 and to_robot @ way > 0:
                return
        if left <= self.speed * dt:
            self.position = self.points[self.heading].copy()
            self.heading = (self.heading + 1) % len(self.points)
        else:
            self.position = self.position + way / left * self.speed * dt


@dataclass
class Hall:
    """Walls and mapped things as polygons, in metres; the map covers ``width`` x ``height`` from the origin."""

    width: float
    height: float
    mapped: list[Array] = field(default_factory=list)
    overlays: list[dict] = field(default_factory=list)
    wall: float = 0.2

    def __post_init__(self) -> None:
        w, h, t = self.width, self.height, self.wall
        self.mapped = [
            box(w / 2, t / 2, w, t),
            box(w / 2, h - t / 2, w, t),
            box(t / 2, h / 2, t, h),
            box(w - t / 2, h / 2, t, h),
            *self.mapped,
        ]

    def map(self) -> MapData:
        size = round(self.width / RESOLUTION), round(self.height / RESOLUTION)
        fine = 4 if self.width < 150.0 else 1
        image = Image.new("L", (size[0] * fine, size[1] * fine), 0)
        draw = ImageDraw.Draw(image)
        for polygon in self.mapped:
            draw.polygon([tuple(p) for p in polygon / RESOLUTION * fine - 0.5], fill=255)
        filled = np.asarray(image).reshape(size[1], fine, size[0], fine).mean(axis=(1, 3)) >= 127
        grey = np.where(filled, 0, 254).astype(np.uint8)[::-1]
        stream = io.BytesIO()
        Image.fromarray(grey).save(stream, "PNG")
        return MapData(
            id=1, uid="hall", map_name="hall", create_time=0, last_modified_time=0, png=stream.getvalue(),
            origin=(0.0, 0.0), resolution=RESOLUTION,
            overlays={"type": "FeatureCollection", "features": self.overlays},
        )  # fmt: skip


@njit(cache=True)
def _cast(x: float, y: float, yaw: float, segments: Array, discs: Array, n: int, reach: float) -> Array:
    ranges = np.full(n, np.inf)
    for k in range(n):
        angle = yaw - math.pi + k * 2 * math.pi / n
        dx, dy = math.cos(angle), math.sin(angle)
        best = reach
        for s in range(segments.shape[0]):
            ax, ay = segments[s, 0] - x, segments[s, 1] - y
            ex, ey = segments[s, 2] - segments[s, 0], segments[s, 3] - segments[s, 1]
            det = ex * dy - ey * dx
            if abs(det) < 1e-12:
                continue
            t = (ex * ay - ey * ax) / det
            u = (dx * ay - dy * ax) / det
            if 0.0 < t < best and 0.0 <= u <= 1.0:
                best = t
        for s in range(discs.shape[0]):
            ax, ay = discs[s, 0] - x, discs[s, 1] - y
            along = ax * dx + ay * dy
            off = ax * ax + ay * ay - along * along
            if along > 0 and off < discs[s, 2] ** 2:
                best = min(best, along - math.sqrt(discs[s, 2] ** 2 - off))
        if best < reach:
            ranges[k] = best
    return ranges


def overlap(a: Array, b: Array) -> bool:
    """Whether two convex polygons overlap (separating axes, first those of the frame)."""
    if (a.max(axis=0) < b.min(axis=0)).any() or (b.max(axis=0) < a.min(axis=0)).any():
        return False
    for polygon in (a, b):
        sides = np.roll(polygon, -1, axis=0) - polygon
        for normal in np.column_stack([sides[:, 1], -sides[:, 0]]):
            pa, pb = a @ normal, b @ normal
            if pa.max() < pb.min() or pb.max() < pa.min():
                return False
    return True


def touches_disc(body: Array, centre: Array, radius: float) -> bool:
    sides = np.roll(body, -1, axis=0) - body
    t = np.clip(np.sum((centre - body) * sides, axis=1) / np.sum(sides * sides, axis=1), 0, 1)
    nearest = body + t[:, None] * sides
    if np.hypot(*(nearest - centre).T).min() < radius:
        return True
    rel = centre - body
    return bool((sides[:, 0] * rel[:, 1] - sides[:, 1] * rel[:, 0] > 0).all())


class Plant:
    """The world and the robot in it; ``observe`` measures, ``drive`` moves it all on by one tick."""

    def __init__(self, hall: Hall, pose: tuple[float, float, float], seed: int = 0) -> None:
        self.hall = hall
        self.crates: list[Array] = []
        self.walkers: list[Walker] = []
        self.pose = np.array(pose, dtype=float)
        self.v = self.w = 0.0
        self.stamp = 0
        self.contacts: list[tuple[float, str]] = []
        self.wheels_blocked = self.lidar_dead = self.lidar_blind = self.pose_lost = False
        self._random = np.random.default_rng(seed)
        self._odometry = np.zeros(3)
        self._scan: Scan | None = None
        self._measured: tuple[int, Pose2] | None = None
        self._touching: set[str] = set()
        self.commands: list[tuple[int, Twist2]] = []
        self.drift = 1.0 + self._random.normal(0, 0.002), self._random.normal(0, 0.002)

    @property
    def seconds(self) -> float:
        return self.stamp / 1e9

    def body(self) -> Array:
        c, s = math.cos(self.pose[2]), math.sin(self.pose[2])
        return BODY @ np.array([(c, s), (-s, c)]) + self.pose[:2]

    def observe(self) -> Observation:
        if not self.pose_lost or self._measured is None:
            noise = self._random.normal(0, (0.01, 0.01, 0.005))
            x, y, yaw = self.pose + noise
            self._measured = self.stamp, Pose2(x=x, y=y, yaw=yaw)
        if self.stamp % (2 * TICK) == 0 and not self.lidar_dead:
            self._scan = self._look()
        x, y, yaw = self._odometry
        return Observation(
            stamp=self.stamp,
            pose=self._measured[1],
            pose_stamp=self._measured[0],
            odometry=Pose2(x=x, y=y, yaw=yaw),
            twist=Twist2(linear=self.v, angular=self.w),
            scan=self._scan,
        )

    def _look(self) -> Scan:
        polygons = [*self.hall.mapped, *self.crates]
        segments = np.vstack([np.hstack([p, np.roll(p, -1, axis=0)]) for p in polygons])
        discs = np.array([(*w.position, w.radius) for w in self.walkers]).reshape(-1, 3)
        x, y, yaw = self.pose
        offset = 0.2  # the lidar sits in front of the centre
        ranges = _cast(x + offset * math.cos(yaw), y + offset * math.sin(yaw), yaw, segments, discs, BEAMS, 25.0)
        ranges = ranges + self._random.normal(0, 0.01, BEAMS)
        if self.lidar_blind:
            ranges[:] = np.nan
        return Scan(
            stamp=self.stamp, sensor=Pose2(x=offset, y=0.0, yaw=0.0), angle_min=-math.pi,
            angle_step=2 * math.pi / BEAMS, range_max=25.0, ranges=ranges.astype("<f4"),
        )  # fmt: skip

    def drive(self, command: Twist2) -> None:
        self.commands.append((self.stamp, command))
        for _ in range(round(TICK / 1e9 / SUBSTEP)):
            wanted = (0.0, 0.0) if self.wheels_blocked else (command.linear, command.angular)
            share = SUBSTEP / 0.1
            self.v += (wanted[0] - self.v) * share
            self.w += (wanted[1] - self.w) * share
            self._move(self.pose, self.v, self.w)
            self._move(self._odometry, self.v * self.drift[0], self.w + self.v * self.drift[1])
            for walker in self.walkers:
                walker.step(SUBSTEP, self.pose)
        self.stamp += TICK
        self._touch()

    @staticmethod
    def _move(pose: Array, v: float, w: float) -> None:
        middle = pose[2] + 0.5 * w * SUBSTEP
        pose += (v * math.cos(middle) * SUBSTEP, v * math.sin(middle) * SUBSTEP, w * SUBSTEP)

    def _touch(self) -> None:
        body = self.body()
        touching = {f"mapped {i}" for i, p in enumerate(self.hall.mapped) if overlap(body, p)}
        touching |= {f"crate {i}" for i, p in enumerate(self.crates) if overlap(body, p)}
        touching |= {f"walker {i}" for i, w in enumerate(self.walkers) if touches_disc(body, w.position, w.radius)}
        self.contacts += [(self.seconds, name) for name in sorted(touching - self._touching)]
        self._touching = touching


@dataclass(frozen=True)
class Told:
    """One tick as clients see it."""

    twist: Twist2
    arrived: bool
    remaining_distance: float
    stuck_state: str
    path: Array
    replanned: bool
    viewport_blocked: bool


class Robot:
    """The planner's core below requests and modes, in lockstep with a plant: ``tick`` measures and commands."""

    def __init__(
        self, plant: Plant, settings: NavigationSettings | None = None, registry: Registry = BEHAVIORS
    ) -> None:
        self.plant = plant
        self.state = ChassisState()
        self.state.take(chassis_model(BODY))
        self.motion = Motion(settings or NavigationSettings(), _EXECUTOR, registry)
        self.motion.plans.lockstep = True
        self.motion.set_model(self.state.model)
        self.motion.set_map(plant.hall.map())
        self._plans = 0

    @property
    def costmap(self) -> LocalCostmap:
        assert self.motion.perception.costmap is not None
        return self.motion.perception.costmap

    def restart(self, plant: Plant) -> None:
        """Another run of the driver, in another plant."""
        self.plant = plant
        self.state.forget()
        self.motion.reset()

    def start(self, goal: Goal) -> None:
        """Take a move to a goal; the next ``tick`` begins it."""
        self.begin(
            MoveCreate(
                type="standard",
                target_x=goal.x,
                target_y=goal.y,
                target_ori=goal.yaw,
                target_accuracy=goal.accuracy,
                use_target_zone=goal.zone,
                properties={"inplace_rotate": goal.rotate_in_place},
            )
        )

    def begin(self, request: MoveCreate) -> None:
        self.motion.begin(request)
        self._plans = 0

    def tick(self) -> Told:
        """One tick of the running move; the plant does not move. Raises ``MoveFailed``."""
        self._measure()
        move, outcome = self.motion.move, None
        assert move is not None, "tick without a move"
        if (trouble := self.state.pose_trouble()) is not None:
            move.wait(trouble, self.plant.stamp)
        else:
            outcome = self.motion.step(self.state)
        twist = self._command(outcome if isinstance(outcome, Drive) else None)
        status = move.status()
        before, self._plans = self._plans, status.plans
        return Told(
            twist, isinstance(outcome, Done), status.remaining_distance, status.stuck_state, status.path,
            status.plans > max(before, 1), status.viewport_blocked,
        )  # fmt: skip

    def hold(self) -> Twist2:
        """A tick in which the move is held, as by an emergency stop."""
        assert self.motion.move is not None
        self.motion.move.hold("held")
        return self.brake()

    def brake(self) -> Twist2:
        """A tick without a move, or with one that is held."""
        self._measure()
        return self._command(None)

    def want(self, twist: Twist2) -> Twist2:
        """A tick that wants a twist without a move, as remote driving does."""
        self._measure()
        return self._command(Drive(twist))

    def _measure(self) -> None:
        seen = self.plant.observe()
        pose = LocalisedPose(stamp=seen.pose_stamp, pose=seen.pose, covariance=np.eye(3) * 1e-4, quality=8)
        odometry = Odometry(stamp=seen.stamp, pose=seen.odometry, twist=seen.twist, wheel_velocities=(0.0, 0.0))
        for message in (pose, seen.scan, odometry):
            if message is not None:
                self.state.take(message)
        self.motion.perceive(self.state)

    def _command(self, wanted: Drive | None) -> Twist2:
        return self.motion.command(wanted, self.state, self.motion.settings.control)


def run(robot: Robot, plant: Plant, goal: Goal, seconds: float) -> list[Told]:
    """Drive to a goal; returns what was told at each tick. Raises ``MoveFailed``, or ``TimeoutError``."""
    robot.start(goal)
    return keep_on(robot, plant, seconds)


def keep_on(robot: Robot, plant: Plant, seconds: float) -> list[Told]:
    end = plant.stamp + int(seconds * 1e9)
    told = []
    while plant.stamp < end:
        told.append(robot.tick())
        plant.drive(told[-1].twist)
        if told[-1].arrived:
            robot.motion.end()
            return told
    raise TimeoutError(f"not there after {seconds} s, at {plant.pose}")


def idle(robot: Robot, plant: Plant, seconds: float) -> None:
    end = plant.stamp + int(seconds * 1e9)
    while plant.stamp < end:
        plant.drive(robot.brake())


def off_line(points: Array, at: Array) -> float:
    """Metres from a point (2,) to a polyline (n, 2)."""
    sides = np.diff(points, axis=0)
    along = np.clip(np.sum((at - points[:-1]) * sides, axis=1) / np.sum(sides * sides, axis=1), 0.0, 1.0)
    return float(np.hypot(*(at - points[:-1] - along[:, None] * sides).T).min())
