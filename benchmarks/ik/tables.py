"""The tables: one step on every course, settling, pose search, start-up."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field

import numpy as np

from benchmarks.ik import rivals
from benchmarks.ik.floor import Bare
from benchmarks.ik.ours import Ours, OursWithRows
from benchmarks.ik.paths import courses
from benchmarks.ik.placo_process import PlacoMissing, PlacoProcess
from benchmarks.ik.search import ANGULAR, LINEAR, Found, Pair, search_all
from benchmarks.ik.walk import CHUNK, DT, Array, Chunk, Course, Walker
from benchmarks.report import Report, Table, median, percentile
from rackhand.services.controller.ik import Arm, DifferentialIk, forward, load_arm, solve_pose

ARMS = ("ur5e", "fr3")
PAIRS = 1000
COMMAND = "python -m benchmarks ik"


@dataclass
class Result:
    """One controller's walk of one course; ``floor`` and ``ours``: chunks of the same turns to compare with."""

    name: str
    limits: str
    chunks: list[Chunk] = field(default_factory=list)
    floor: list[Chunk] = field(default_factory=list)
    ours: list[Chunk] = field(default_factory=list)

    @property
    def micros(self) -> list[float]:
        return [one for chunk in self.chunks for one in chunk.micros]

    @property
    def failed(self) -> int:
        return sum(chunk.failed for chunk in self.chunks)

    @property
    def to_floor(self) -> float:
        return _ratio(self.chunks, self.floor)

    @property
    def to_ours(self) -> float:
        return _ratio(self.chunks, self.ours)

    def keeps(self, arm: Arm) -> tuple[float, float, float]:
        """Largest speed and acceleration as parts of their limits, and how far [rad] a joint was out of its range."""
        limits = arm.limits
        q = np.array([one for chunk in self.chunks for one in chunk.q])
        v = np.array([one for chunk in self.chunks for one in chunk.v])
        rate = np.diff(v, axis=0, prepend=np.zeros((1, arm.n))) / DT
        beyond = np.maximum(q - limits.upper, limits.lower - q)
        speed, change = np.abs(v) / limits.velocity, np.abs(rate) / limits.acceleration
        return float(speed.max()), float(change.max()), max(0.0, float(beyond.max()))

    def errors(self, arm: Arm, course: Course) -> Array:
        """Distance [mm] between tool and target after each step."""
        q = [one for chunk in self.chunks for one in chunk.q]
        ends = zip(q, course.poses[1:], strict=False)
        return np.array([1e3 * np.linalg.norm(forward(arm, joints)[:, 3] - pose[:, 3]) for joints, pose in ends])


def _ratio(chunks: Sequence[Chunk], others: Sequence[Chunk]) -> float:
    """Median over the turns of the ratio of their medians: another job that comes between spoils neither."""
    return median([median(a.micros) / median(b.micros) for a, b in zip(chunks, others, strict=True)])


def walk_course(arm: Arm, course: Course, placo: PlacoProcess | None) -> list[Result]:
    """Floor, ours, then the rivals; placo's floor is that of its own process."""
    floor = Bare(arm.model, arm.model.getFrameId("flange"))
    controllers = [floor, Ours(arm), OursWithRows(arm), *rivals.rivals(arm)]
    walkers = [Walker(controller, course) for controller in controllers]
    results = [Result(controller.name, controller.limits) for controller in controllers]
    apart = Result("placo", "position, velocity")
    if placo:
        placo.take_course(course)
    for first in range(0, len(course.twists), CHUNK):
        turn = [walker.walk(first) for walker in walkers]
        for result, chunk in zip(results, turn, strict=True):
            _note(result, chunk, turn[0], turn[1])
        if placo:
            its_floor, chunk = placo.walk(first)
            _note(apart, chunk, its_floor, turn[1])
    return [*results, apart] if placo else results


def _note(result: Result, chunk: Chunk, floor: Chunk, ours: Chunk) -> None:
    result.chunks.append(chunk)
    result.floor.append(floor)
    result.ours.append(ours)


def step_tables(arms: Sequence[Arm], seconds: float, placo: PlacoProcess | None) -> tuple[list[list[str]], list[Table]]:
    """The summary's rows, and a table for each arm and course."""
    summary, tables = [], []
    for arm in arms:
        if placo:
            placo.take_arm(arm)
        for course in courses(arm, seconds):
            results = walk_course(arm, course, placo)
            summary.append(_summary(arm, course, results))
            rows = [_row(arm, course, result) for result in results]
            tables.append(Table(f"One step: {arm.name}, {course.label}", _STEP_HEADER, rows))
    return summary, tables


_RIVALS = ("pink", "mink", "roboplan OInK", "placo")
_SUMMARY_HEADER = (
    "arm", "path", "µs", "÷ bare", *(f"{name} ÷ ours" for name in _RIVALS), "no solution", "limits broken",
)  # fmt: skip
_STEP_HEADER = (
    "controller", "limits", "µs median / p99", "÷ bare", "÷ ours", "no solution", "speed ÷ limit",
    "acceleration ÷ limit", "out of range rad", "error mm median / end",
)  # fmt: skip


def _summary(arm: Arm, course: Course, results: Sequence[Result]) -> list[str]:
    ours = results[1]
    speed, rate, beyond = ours.keeps(arm)
    broken = (speed > 1 + 1e-9) + (rate > 1 + 1e-9) + (beyond > 1e-9)
    # Of a rival that has acceleration limits, with them.
    last = {result.name: result for result in results}
    ratios = [f"{last[name].to_ours:.1f}" if name in last else "-" for name in _RIVALS]
    return [
        arm.name, course.label, f"{median(ours.micros):.1f}", f"{ours.to_floor:.2f}", *ratios, str(ours.failed),
        str(broken),
    ]  # fmt: skip


def _row(arm: Arm, course: Course, result: Result) -> list[str]:
    (speed, rate, beyond), errors = result.keeps(arm), result.errors(arm, course)
    return [
        result.name, result.limits, f"{median(result.micros):.1f} / {percentile(result.micros, 0.99):.0f}",
        f"{result.to_floor:.2f}", f"{result.to_ours:.2f}", str(result.failed), f"{speed:.3g}", f"{rate:.3g}",
        f"{beyond:.0e}" if beyond else "0", f"{np.median(errors):.4f} / {errors[-1]:.3f}",
    ]  # fmt: skip


def settle_table(arms: Sequence[Arm]) -> Table:
    """Steps of up to 0.5 rad a joint, 20 of them: time to 0.1 mm and 0.05°, for good."""
    rows = []
    for arm in arms:
        random, times, ideal = np.random.default_rng(3), [], []
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
        rows.append([arm.name, f"{within} of 20", f"{median(times):.3f}", f"{max(times):.3f}", f"{max(ideal):.3f}"])
    header = ["arm", "within 0.5 s", "median s", "most s", "slowest joint alone, bang-bang, most s"]
    remarks = (
        "A target up to 0.5 rad a joint away, reached to 0.1 mm and 0.05° for good; all limits kept. Seed 3; the last "
        "column is for the joint move that the target was made from."
    )
    return Table("Settling", header, rows, remarks)


def pose_tables(arms: Sequence[Arm], placo: PlacoProcess | None, poses: int) -> list[Table]:
    """A pose from anywhere beside the rivals, and TRAC-IK's task."""
    rows, trac = [], []
    for arm in arms:
        pairs = random_pairs(arm, PAIRS, 7)
        rows.append(_found_row(arm, "rackhand", solve_all(arm, pairs, LINEAR, ANGULAR)))
        floor = Bare(arm.model, arm.model.getFrameId("flange"))
        for stepper in rivals.steppers(arm):
            found = search_all(stepper, floor.distance, arm.limits.lower, arm.limits.upper, pairs)
            rows.append(_found_row(arm, stepper.name, found))
        if placo:
            placo.take_arm(arm)
            rows.append(_found_row(arm, "placo", placo.search(pairs)))
        from_home = [Pair(arm.home, pair.target) for pair in random_pairs(arm, poses, 8)]
        trac.append(_found_row(arm, "rackhand", solve_all(arm, from_home, 1e-5, 1e-5)))
    header = ["arm", "solver", "solved %", "with 0 / ≤1 / ≤5 restarts %", "most restarts", "µs median / mean / p95"]
    return [
        Table(
            "A pose from anywhere", header, rows,
            f"{PAIRS} pairs of random start and pose, seed 7, within 1 mm and 0.5°, at most 20 restarts. For a restart "
            "ours takes the best of some random postures; the others, which bring no search, step with position limits "
            "and at most 0.5 rad a joint, and begin anew at random when ten steps gain less than a tenth.",
        ),
        Table(
            "TRAC-IK's task", header, trac,
            f"{poses} random reachable poses, seed 8, within 1e-5 m and rad, from home, at most 20 restarts.",
        ),
    ]  # fmt: skip


def random_pairs(arm: Arm, count: int, seed: int) -> list[Pair]:
    random, limits = np.random.default_rng(seed), arm.limits
    both = random.uniform(limits.lower, limits.upper, (count, 2, arm.n))
    return [Pair(start, forward(arm, goal)) for start, goal in both]


def solve_all(arm: Arm, pairs: Sequence[Pair], linear: float, angular: float) -> list[Found]:
    for pair in pairs[:20]:  # compile and warm up, restarts included
        solve_pose(arm, pair.target, pair.start)
    found = []
    for i, pair in enumerate(pairs):
        begun = time.perf_counter_ns()
        one = solve_pose(arm, pair.target, pair.start, linear_tolerance=linear, angular_tolerance=angular, seed=i)
        found.append(Found((time.perf_counter_ns() - begun) / 1e3, one.reached, one.restarts))
    return found


def _found_row(arm: Arm, name: str, found: Sequence[Found]) -> list[str]:
    shares = [f"{100 * np.mean([f.reached and f.restarts <= most for f in found]):.1f}" for most in (0, 1, 5)]
    micros = [f.micros for f in found]
    return [
        arm.name, name, f"{100 * np.mean([f.reached for f in found]):.2f}", " / ".join(shares),
        str(max((f.restarts for f in found if f.reached), default=0)),
        f"{median(micros):.0f} / {np.mean(micros):.0f} / {percentile(micros, 0.95):.0f}",
    ]  # fmt: skip


_STARTER = """
import json, time
begun = time.perf_counter()
import numpy, pinocchio, mujoco
libraries = time.perf_counter()
from rackhand.services.controller.ik import DifferentialIk, load_arm
imported = time.perf_counter()
arm = load_arm("ur5e")
ik = DifferentialIk(arm, 0.004)
loaded = time.perf_counter()
ik.step(arm.home, numpy.zeros(arm.n), ik.forward(arm.home))
print(json.dumps([libraries - begun, imported - libraries, loaded - imported, time.perf_counter() - loaded]))
"""


def start_table() -> Table:
    """From nothing to the first step, with an empty numba cache and again with the one that left."""
    rows = []
    with tempfile.TemporaryDirectory() as cache:
        for label in ("first ever, compiles", "every other"):
            done = subprocess.run(
                [sys.executable, "-c", _STARTER], env=os.environ | {"NUMBA_CACHE_DIR": cache}, check=True,
                capture_output=True, text=True,
            )  # fmt: skip
            rows.append([label, *(f"{seconds:.2f}" for seconds in json.loads(done.stdout))])
    header = ["start", "numpy, pinocchio, mujoco s", "import of ours s", "arm loaded s", "first step s"]
    return Table("Start-up", header, rows, "A new process each; the first has an empty numba cache.")


def report(seconds: float, poses: int) -> Report:
    arms, notes = [load_arm(name) for name in ARMS], [rivals.missing()]
    with ExitStack() as stack:
        placo = None
        try:
            placo = stack.enter_context(PlacoProcess())
        except PlacoMissing as why:
            notes.append(f"placo is not compared: {why}.")
        summary, tables = step_tables(arms, seconds, placo)
        tables += [settle_table(arms), *pose_tables(arms, placo, poses), start_table()]
    remarks = (
        f"One step with position, velocity and acceleration limits, {seconds:.0f} s of each path at 500 Hz. ÷ bare: "
        "beside pinocchio's forward kinematics, Jacobian and one damped least-squares step without any limit. Rivals "
        "have the same task and posture, position and velocity limits; here pink and OInK also those of acceleration, "
        "which mink and placo do not have. All take turns after every 50 steps, and ratios are medians over the turns; "
        "placo needs another pinocchio and walks in a process of its own with a floor of its own. Paths: nominal (no "
        "limit active), edge (0.75 m further out than home, beyond reach, and back), fast (beyond velocity and "
        "acceleration limits), wrist (through a singularity of the wrist). "
    )
    notes_text = " ".join(filter(None, notes))
    return Report("Inverse kinematics", COMMAND, _SUMMARY_HEADER, summary, remarks + notes_text, tables)
