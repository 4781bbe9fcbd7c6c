"""Inverse kinematics beside bare pinocchio and, where installed, pink and mink: time a step, limits kept, settling,
poses.

    python -m benchmarks.ik [--seconds 5]       (pip install pin-pink mink daqp   in an environment of its own, to
    compare)

All controllers walk the same paths at 500 Hz, interleaved in chunks of 50 steps so that the machine's noise hits all
alike; `ratio` is the median over chunks of the time divided by that of the first row in the same chunk.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np
import pinocchio as pin
from scipy.linalg.lapack import dposv

from benchmarks.report import Report, median, percentile
from services.controller.ik import Arm, DifferentialIk, forward, load_arm, solve_pose

from .paths import DT, PATHS, Array, Path
from .rivals import Controller, rivals

CHUNK = 50


@dataclass
class Bare:
    """Pinocchio's kinematics, log6 and one damped least-squares step: no limits, no posture. What everything costs
    more than."""

    arm: Arm
    name: str = "bare pinocchio + damped least squares"
    limits: str = "none"

    def __post_init__(self) -> None:
        self.model, self.data = self.arm.model, self.arm.model.createData()
        self.frame = self.model.nframes - 1
        self.eye = 1e-6 * np.eye(self.arm.n)

    def step(self, q: Array, _v: Array, _now: Array, then: Array, _twist: Array) -> Array:
        jac = pin.computeFrameJacobian(self.model, self.data, q, self.frame)
        error = pin.log6(self.data.iMf[0].actInv(self.target(then))).vector
        _, step, _ = dposv(np.dot(jac.T, jac) + self.eye, error @ jac)
        return np.asarray(step) / DT

    def target(self, pose: Array) -> pin.SE3:
        return pin.SE3(pose[:, :3], pose[:, 3])


class Ours:
    """`DifferentialIk` with a posture objective."""

    name, limits = "rackhand", "position, velocity, acceleration"

    def __init__(self, arm: Arm) -> None:
        self.ik = DifferentialIk(arm, DT, blend_time=0.0)
        self.ik.objectives.configure("DesiredJointPositions", {"enable": True, "attraction": arm.home, "c": 5.0})

    def step(self, q: Array, v: Array, now: Array, _then: Array, twist: Array) -> Array:
        return self.ik.step(q, v, now, twist).velocity


class OursWithRows(Ours):
    """The same with all of the arm's own spheres against each other."""

    name, limits = "rackhand, self-collision rows", "the same and 5 to 9 gaps"

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm)
        self.ik.set_zones((), self_collision=True)


@dataclass
class Trial:
    """One controller on one path."""

    controller: Controller
    arm: Arm
    q: Array
    v: Array
    micros: list[float] = field(default_factory=list)
    chunks: list[float] = field(default_factory=list)
    failed: int = 0
    speed: float = 0.0  # largest, as a part of the limit
    rate: float = 0.0
    outside: float = 0.0  # [rad]
    errors: list[float] = field(default_factory=list)  # [mm]

    def walk(self, path: Path, first: int) -> None:
        limits, spent = self.arm.limits, 0.0
        for i in range(first, first + CHUNK):
            now, then = path(i * DT), path((i + 1) * DT)
            twist = np.concatenate([then[:, 3] - now[:, 3], pin.log3(then[:, :3] @ now[:, :3].T)]) / DT
            started = time.perf_counter_ns()
            try:
                v = self.controller.step(self.q, self.v, now, then, twist)
            except Exception:  # whatever a rival raises when it finds no solution: it then stands still for this step
                v, self.failed = np.zeros(self.arm.n), self.failed + 1
            took = (time.perf_counter_ns() - started) / 1e3
            self.micros.append(took)
            spent += took
            self.speed = max(self.speed, float(np.max(np.abs(v) / limits.velocity)))
            self.rate = max(self.rate, float(np.max(np.abs(v - self.v) / DT / limits.acceleration)))
            self.q, self.v = self.q + v * DT, v
            beyond = np.maximum(self.q - limits.upper, limits.lower - self.q)
            self.outside = max(self.outside, float(np.max(beyond)))
            self.errors.append(1e3 * float(np.linalg.norm(forward(self.arm, self.q)[:, 3] - then[:, 3])))
        self.chunks.append(spent)


def step_table(seconds: float) -> Report:
    """Every controller on every path of every arm."""
    rows, missing = [], ""
    for name in ("ur5e", "fr3"):
        arm = load_arm(name)
        for label, start, path in PATHS(arm):
            found, missing = rivals(arm)
            controllers: list[Controller] = [Bare(arm), Ours(arm), OursWithRows(arm), *found]
            trials = [Trial(controller, arm, start.copy(), np.zeros(arm.n)) for controller in controllers]
            for trial in trials:  # compile and warm up
                trial.controller.step(start, np.zeros(arm.n), path(0.0), path(0.0), np.zeros(6))
            for first in range(0, round(seconds / DT), CHUNK):
                for trial in trials:
                    trial.walk(path, first)
            for trial in trials:
                ratio = median([a / b for a, b in zip(trial.chunks, trials[0].chunks, strict=True)])
                rows.append([
                    name, label, trial.controller.name, trial.controller.limits, f"{ratio:.2f}",
                    f"{median(trial.micros):.1f} / {percentile(trial.micros, 0.99):.0f}", str(trial.failed),
                    f"{trial.speed:.3g}", f"{trial.rate:.3g}", f"{max(0.0, trial.outside):.1e}",
                    f"{median(trial.errors):.4f} / {trial.errors[-1]:.3f}",
                ])  # fmt: skip
    header = [
        "arm", "path", "controller", "limits", "ratio", "µs median / p99", "no solution", "speed ÷ limit",
        "acceleration ÷ limit", "outside limits rad", "error mm median / end",
    ]  # fmt: skip
    remarks = (
        f"{seconds:.0f} s of each path at 500 Hz. Times shared with other jobs of the machine: compare ratios. "
        "Paths: nominal (no limit active), edge (out of reach and back), fast (beyond velocity and acceleration "
        f"limits), wrist (through the singularity of the UR's wrist). {missing}"
    )
    return Report("Inverse kinematics: one step", "python -m benchmarks.ik", header, rows, remarks)


def settle_table() -> Report:
    """Steps of up to 0.5 rad a joint, 20 of them: time to 0.1 mm and 0.05°, for good."""
    rows = []
    for name in ("ur5e", "fr3"):
        arm, random, times, ideal = load_arm(name), np.random.default_rng(3), [], []
        ik = DifferentialIk(arm, DT)
        for _ in range(20):
            q = np.clip(arm.home + random.uniform(-0.3, 0.3, arm.n), arm.limits.lower + 0.05, arm.limits.upper - 0.05)
            goal = np.clip(q + random.uniform(-0.5, 0.5, arm.n), arm.limits.lower, arm.limits.upper)
            target, v, last = forward(arm, goal), np.zeros(arm.n), 0
            ideal.append(float(np.max(2 * np.sqrt(np.abs(goal - q) / arm.limits.acceleration))))
            for i in range(round(2.0 / DT)):
                step = ik.step(q, v, target)
                v = step.velocity
                if step.linear_error > 1e-4 or step.angular_error > np.deg2rad(0.05):
                    last = i + 1
                q = q + v * DT
            times.append(last * DT)
        within = sum(t <= 0.5 for t in times)
        rows.append([name, f"{within} of 20", f"{median(times):.3f}", f"{max(times):.3f}", f"{max(ideal):.3f}"])
    header = ["arm", "within 0.5 s", "median s", "max s", "slowest joint alone, bang-bang, max s"]
    remarks = "All limits kept. Seed 3; the last column is for the joint move the target was made from."
    return Report("Inverse kinematics: settling", "python -m benchmarks.ik", header, rows, remarks)


def pose_table(poses: int) -> Report:
    """Pose search from random starts, and TRAC-IK's task from one start."""
    rows = []
    for name in ("ur5e", "fr3"):
        arm = load_arm(name)
        for label, count, tolerance, seed in (
            ("1 mm, 0.5°, random start", 1000, (1e-3, float(np.deg2rad(0.5))), 7),
            ("1e-5, from home (TRAC-IK's)", poses, (1e-5, 1e-5), 8),
        ):
            random, micros, restarts, solved = np.random.default_rng(seed), [], [], 0
            for i in range(count):
                goal, other = random.uniform(arm.limits.lower, arm.limits.upper, (2, arm.n))
                start, target = (other if label.startswith("1 mm") else arm.home), forward(arm, goal)
                began = time.perf_counter_ns()
                linear, angular = tolerance
                found = solve_pose(arm, target, start, linear_tolerance=linear, angular_tolerance=angular, seed=i)
                micros.append((time.perf_counter_ns() - began) / 1e3)
                solved += found.reached
                restarts.append(found.restarts)
            shares = [f"{100 * np.mean([r <= most for r in restarts]):.1f}" for most in (0, 1, 5)]
            rows.append([
                name, label, str(count), f"{100 * solved / count:.2f}", " / ".join(shares), str(max(restarts)),
                f"{median(micros):.0f} / {percentile(micros, 0.95):.0f}",
            ])  # fmt: skip
    header = ["arm", "task", "poses", "solved %", "with 0 / ≤1 / ≤5 restarts %", "most restarts", "µs median / p95"]
    remarks = "Poses of uniformly random joint positions, seeds 7 and 8; at most 20 restarts."
    return Report("Inverse kinematics: poses", "python -m benchmarks.ik", header, rows, remarks)


def run(seconds: float = 5.0, poses: int = 10_000) -> Report:
    """All three, as one report: the tables of settling and poses follow the first."""
    steps = step_table(seconds)
    rest = "\n".join(table.markdown().replace("## ", "### ") for table in (settle_table(), pose_table(poses)))
    return Report(steps.title, steps.command, steps.header, steps.rows, f"{steps.remarks}\n\n{rest}")
