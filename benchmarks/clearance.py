"""Random paths in the pick station: what is driven must not touch anything, what is refused must not be clear."""

from __future__ import annotations

import heapq
import itertools
import json
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from benchmarks.progress import say, track
from benchmarks.report import Report, Table
from rackhand.schemas.arrays import Array
from rackhand.schemas.world import Reset
from rackhand.services.controller import ik
from rackhand.services.controller.ik.clearance import MARGIN
from rackhand.services.controller.motion.path_clearance import PathClearance
from rackhand.services.controller.motion.profile import MotionProfile, path_arm
from rackhand.services.controller.trajectory.curve import JointCurve
from rackhand.services.controller.trajectory.model import PathRefused, TcpPose
from rackhand.services.controller.trajectory.queue import Method, MotionQueue, ReferenceFrame
from rackhand.services.controller.trajectory.stream import Motion
from rackhand.worlds.arm_model import with_arm_kind
from rackhand.worlds.world_model import load_world
from tests.controller.station import CELLS, scene
from tests.joined.arm import OK
from tests.joined.world import JoinedWorld

COUNT, SEED = 2000, 20
DRIVEN_IN_PHYSICS = 40
KINDS, FORMS = ("ur5e", "fr3"), ("joints", "task")
SPREAD = {"joints": 1.4, "task": 0.9}  # rad of a waypoint's joints from home
FAR, KNOWN = 2.0, 8e-3  # m: distances are looked for up to the one, and told up to the other
WITHIN = 5e-4  # m that two computations of the distance may differ
POSTURES = 4000  # of a path that may be looked at, evenly along it


@dataclass(frozen=True)
class Options:
    """``count``: how many paths, from the first on. ``results``: file that is written after each path and from which a
    run goes on."""

    count: int = COUNT
    results: Path = Path("clearance-results.jsonl")


@dataclass(frozen=True)
class Verdict:
    """``driven``: accepted. ``about``: refused because of clearance, not of reach or limits. ``nearest`` [m]: by the
    geometry of the physics along the whole path, NaN where there is none."""

    number: int
    kind: str
    form: str
    driven: bool
    about: bool
    nearest: float
    text: str = ""


class Nearest:
    """How near an arm's solids come to each other and to the station, from the compiled model of the physics alone."""

    def __init__(self, kind: str) -> None:
        self._model, self._data, self._joints = scene(kind)
        self._pairs = list(_colliding_pairs(self._model))
        levers = [_levers(self._model, geom) for geom in range(self._model.ngeom)]
        # Joints that carry both solids of a pair alike do not change their distance.
        self._levers = np.array([np.where((levers[a] > 0) & (levers[b] > 0), 0, levers[a] + levers[b])
                                 for a, b in self._pairs])  # fmt: skip

    def at(self, q: Array, pairs: Sequence[int]) -> list[float]:
        """Of these pairs [m]."""
        model, data = self._model, self._data
        data.qpos[self._joints] = q
        mujoco.mj_kinematics(model, data)
        return [float(mujoco.mj_geomDistance(model, data, *self._pairs[pair], FAR, None)) for pair in pairs]

    def along(self, curve: JointCurve) -> float:
        """The least distance [m] on ``curve``, at most ``KNOWN``: each pair is looked at where the distance it had
        before, less what its solids may have moved since, is less than that, and at every posture while it is."""
        q = curve.derivatives(np.linspace(curve.start, curve.end, POSTURES))[0]
        travel = np.zeros((POSTURES, len(self._pairs)))
        np.cumsum(np.abs(np.diff(q, axis=0)) @ self._levers[:, : q.shape[1]].T, axis=0, out=travel[1:])
        due = {0: list(range(len(self._pairs)))}
        order, least = [0], KNOWN
        while order:
            i = heapq.heappop(order)
            pairs = due.pop(i)
            for pair, distance in zip(pairs, self.at(q[i], pairs), strict=True):
                least = min(least, distance)
                column = travel[:, pair]
                then = max(i + 1, int(np.searchsorted(column, column[i] + distance - KNOWN, side="right")))
                if then < POSTURES and then not in due:
                    heapq.heappush(order, then)
                if then < POSTURES:
                    due.setdefault(then, []).append(pair)
        return least


def _levers(model: Any, geom: int) -> Array:
    """(n,) [m], of the arm's joints in their order: no point of ``geom`` is farther from the axis of a joint that moves
    it; 0 of the joints that do not."""
    arm = [j for j in range(model.njnt) if model.joint(j).name.startswith("arm1/")]
    out = np.zeros(len(arm))
    body = int(model.geom_bodyid[geom])
    reach = float(np.linalg.norm(model.geom_pos[geom]) + model.geom_rbound[geom])
    while body:
        for j in range(int(model.body_jntadr[body]), int(model.body_jntadr[body] + model.body_jntnum[body])):
            if j in arm:
                out[arm.index(j)] = reach
        reach += float(np.linalg.norm(model.body_pos[body]))
        body = int(model.body_parentid[body])
    return out


def _colliding_pairs(model: Any) -> Iterator[tuple[int, int]]:
    """Pairs of geoms that the physics lets collide, one of the arm at least."""
    arm = [
        model.geom(g).name.startswith("arm1/") or model.body(int(model.geom_bodyid[g])).name.startswith("arm1/")
        for g in range(model.ngeom)
    ]
    excluded = {int(signature) for signature in model.exclude_signature}
    for a, b in itertools.combinations(range(model.ngeom), 2):
        if not (arm[a] or arm[b]) or not (
            model.geom_contype[a] & model.geom_conaffinity[b] or model.geom_contype[b] & model.geom_conaffinity[a]
        ):
            continue
        one, other = int(model.geom_bodyid[a]), int(model.geom_bodyid[b])
        fixed, also = int(model.body_weldid[one]), int(model.body_weldid[other])
        if fixed == also or {(one << 16) + other, (other << 16) + one} & excluded:
            continue
        parent, above = (int(model.body_weldid[model.body_parentid[weld]]) for weld in (fixed, also))
        if (fixed == above or also == parent) and arm[a] and arm[b]:
            continue  # of one joint, which lets them turn beside each other
        yield a, b


def run(options: Options = Options()) -> Report:
    verdicts = _known(options.results)
    judges = {kind: Judge(kind) for kind in KINDS}
    with options.results.open("a") as file:
        for number in track(range(options.count), "random paths"):
            if number in verdicts:
                continue
            kind, form = _case(number)
            verdict = verdicts[number] = judges[kind].verdict(number, form)
            file.write(json.dumps(asdict(verdict)) + "\n")
            file.flush()
            for fault in faults(verdict):
                say(f"path {number}: {fault}")
    return report([verdicts[number] for number in range(options.count)], judges)


def _known(results: Path) -> dict[int, Verdict]:
    if not results.exists():
        return {}
    rows = [Verdict(**json.loads(line)) for line in results.read_text().splitlines()]
    return {row.number: row for row in rows}


def _case(number: int) -> tuple[str, str]:
    return KINDS[number % 2], FORMS[number // 2 % 2]


def faults(verdict: Verdict) -> Iterator[str]:
    if verdict.driven and verdict.nearest <= 0.0:
        yield f"is driven and touches ({verdict.kind}, {verdict.form})"
    elif verdict.driven and verdict.nearest < MARGIN - WITHIN:
        yield f"is driven within {1e3 * verdict.nearest:.2f} mm ({verdict.kind}, {verdict.form})"
    if verdict.about and verdict.nearest > MARGIN + WITHIN:
        yield f"is clear by {1e3 * verdict.nearest:.2f} mm and refused: {verdict.text}"


class Judge:
    """Plans paths of one arm from home with and without the check of clearance."""

    def __init__(self, kind: str) -> None:
        self.kind, self.arm = kind, CELLS[kind]
        profile = MotionProfile.default(self.arm)
        self._checked = MotionQueue(path_arm(self.arm, profile, PathClearance(self.arm)), self.arm.home)
        self._any = MotionQueue(path_arm(self.arm, profile), self.arm.home)
        self._nearest = Nearest(kind)

    def verdict(self, number: int, form: str) -> Verdict:
        points = self.points(number, form)
        driven, about, text, curves = True, False, "", []
        try:
            curves = self.planned(self._checked, form, points)
        except PathRefused as refused:
            driven, text = False, str(refused)
            about = "collide" in text or "come within" in text
        if about:
            curves = self.planned(self._any, form, points)
        nearest = min((self._nearest.along(curve) for curve in curves), default=float("nan"))
        return Verdict(number, self.kind, form, driven, about, nearest, text)

    def points(self, number: int, form: str) -> list[Array]:
        """Joint positions of one to three waypoints about home, within the joints' range."""
        rng = np.random.default_rng((SEED, number))
        limits = self.arm.limits
        away = rng.uniform(-SPREAD[form], SPREAD[form], (int(rng.integers(1, 4)), self.arm.n))
        return list(np.clip(self.arm.home + away, limits.lower + 0.01, limits.upper - 0.01))

    def planned(self, queue: MotionQueue, form: str, points: list[Array]) -> list[JointCurve]:
        """Raises ``PathRefused``."""
        if form == "joints":
            planned = queue.append_joints(0.0, points)
        else:
            poses = [ik.forward(self.arm, q) for q in points]
            targets = [TcpPose(pose[:, 3], pose[:, :3]) for pose in poses]
            planned = queue.append_task(0.0, targets, Method.TASK_SPACE, ReferenceFrame.BASE)
        return [queued.motion.curve for queued in planned.motions if isinstance(queued.motion, Motion)]


def report(verdicts: list[Verdict], judges: dict[str, Judge]) -> Report:
    rows = []
    for kind, form in itertools.product(KINDS, FORMS):
        own = [v for v in verdicts if (v.kind, v.form) == (kind, form)]
        driven, refused = [v for v in own if v.driven], [v for v in own if v.about]
        rows.append(
            (
                kind,
                form,
                str(len(own)),
                f"{len(driven)}, of these {sum(v.nearest <= 0 for v in driven)}",
                f"{1e3 * min((v.nearest for v in driven), default=0.0):.1f}",
                f"{len(refused)}, of these {sum(v.nearest > MARGIN + WITHIN for v in refused)}",
                str(len(own) - len(driven) - len(refused)),
            )
        )
    return Report(
        "Clearance of random paths",
        "python -m benchmarks clearance",
        (
            "arm",
            "paths",
            "how many",
            "driven, touch something",
            "nearest driven (mm, told up to 8)",
            "refused, are clear",
            "beyond reach or limits",
        ),
        rows,
        f"World `pick_station`, paths from home through one to three random waypoints within {SPREAD['joints']} rad "
        f"(joints) or to the poses of joints within {SPREAD['task']} rad (task, method 2), by the code that answers "
        "`appendPath`. Judged by the geometry of the compiled MuJoCo model (`mj_geomDistance`, all pairs that the "
        f"physics lets collide), at up to {POSTURES} postures of the planned curve; the controller computes its "
        f"distances with coal from solids of its own and keeps {1e3 * MARGIN:g} mm. A path that keeps that all along "
        "is clear.",
        more=[physics(verdicts, judges)],
    )


def physics(verdicts: list[Verdict], judges: dict[str, Judge]) -> Table:
    """Drives a sample in physics, by a controller that does not know its station: paths that are accepted, and some
    that are refused because of the station."""
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for kind in KINDS:
            scene = with_arm_kind(load_world("pick_station"), kind)
            world = JoinedWorld(scene, Path(folder) / kind, with_stations=False)
            own = [v for v in verdicts if v.kind == kind]
            accepted = [v for v in own if v.driven][: DRIVEN_IN_PHYSICS // 2]
            # Those that the geometry says overlap, so that the physics must find them.
            around = {solid.name for solid in judges[kind].arm.surroundings}
            overlapping = [v for v in own if v.about and v.nearest < -1e-3 and any(name in v.text for name in around)]
            chosen = [*accepted, *overlapping[: DRIVEN_IN_PHYSICS // 4]]
            touched = {v.number: _touches(world, judges[kind], v) for v in track(chosen, f"{kind} in physics")}
            refused = [v for v in overlapping if touched.get(v.number) is not None][: DRIVEN_IN_PHYSICS // 8]
            rows.append(
                (
                    kind,
                    f"{sum(touched[v.number] is not False for v in accepted)} of {len(accepted)}",
                    f"{sum(touched[v.number] is True for v in refused)} of {len(refused)}",
                )
            )
    return Table(
        "The same in physics, a sample",
        ("arm", "accepted paths that touch something", "refused paths that overlap by the geometry, and touch"),
        rows,
        "Driven at the default profile by a controller that does not know its station.",
    )


def _touches(world: JoinedWorld, judge: Judge, verdict: Verdict) -> bool | None:
    """None if this controller refuses the path, too: the arm would come into itself."""
    world.ask(Reset())
    station = world.arm()
    station.advance(0.04)
    points = judge.points(verdict.number, verdict.form)
    if verdict.form == "joints":
        path: dict[str, Any] = {"type": "joints", "data": [q.tolist() for q in points]}
    else:
        poses = [ik.forward(judge.arm, q) for q in points]
        path = {"type": "task", "method": 2, "reference": 1, "data": [_message(pose) for pose in poses]}
    if station.ask("a", command="appendPath", priority=10, **path)["message"] != OK:
        return None
    while station.status()["isTrajectoryRunning"]["value"] and not world.simulation.contact_log.count:
        station.advance(0.2)
    station.advance(0.2)
    return world.simulation.contact_log.count > 0


def _message(pose: Array) -> dict[str, Any]:
    rows = {f"Row{i + 1}": pose[i, :3].tolist() for i in range(3)}
    return {"Position": pose[:, 3].tolist(), "Orientation": {"Matrix": rows}}
