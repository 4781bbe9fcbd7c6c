"""An arm that drives into a crate: whether it stops, how hard it hits, and that nothing moves when the crate goes."""

from __future__ import annotations

import itertools
import math
import tempfile
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from benchmarks.progress import track
from benchmarks.report import Report, Table
from rackhand.schemas.base import Pose2
from rackhand.schemas.crf_contact import Contact
from rackhand.schemas.motion import ArmState
from rackhand.schemas.world import Place, Remove
from rackhand.services.controller import ik
from rackhand.worlds.arm_model import with_arm_kind
from rackhand.worlds.world_model import load_world
from tests.joined.arm import JoinedArm
from tests.joined.world import JoinedWorld

KINDS = ("ur5e", "fr3")
SHARES = (0.1, 0.5, 1.0)  # of the speed of the joints; 0.5 is the default profile
PLACES = 5
SWEEP = -1.2  # rad that joint 0 is asked to turn
SIDE, HEIGHT = 0.12, 1.6  # m, of the crate
AT_REST = 0.02  # rad/s


@dataclass(frozen=True)
class Spot:
    """A crate's place: at ``share`` of the tool's distance from the axis of joint 0, ``angle`` [rad] along the turn."""

    angle: float
    share: float
    yaw: float


@dataclass(frozen=True)
class Hit:
    """``stopped``: contact found, status says so, arm at rest. ``force`` [N]: greatest of the contact. ``time`` [s]:
    from the first touch to rest. ``moved`` [rad]: by any joint in 1.5 s after the crate was taken away. ``goes_on``:
    the same path is driven to its end then."""

    kind: str
    share: float
    stopped: bool
    found: str
    force: float
    time: float
    moved: float
    goes_on: bool


def run() -> Report:
    spots = seeded_spots()
    cases = list(itertools.product(KINDS, SHARES, spots))
    hits: list[Hit] = []
    presses: list[tuple[str, float, float, bool, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        stations = {kind: station(kind, Path(folder)) for kind in KINDS}
        for kind, share, spot in track(cases, "crates in the way"):
            hits.append(hit(stations[kind], kind, share, spot))
        for kind, spot in track(list(itertools.product(KINDS, spots)), "without the stop condition"):
            presses.append((kind, *press(stations[kind], spot)))
    return Report(
        "Arm against a crate",
        "python -m benchmarks contact",
        (
            "arm",
            "share of the joints' speed",
            "stopped",
            "found by",
            "peak force (N)",
            "touch to rest (ms)",
            "moved when the crate went (mrad)",
            "new command driven",
        ),
        [
            _row(kind, share, [h for h in hits if (h.kind, h.share) == (kind, share)])
            for kind in KINDS
            for share in SHARES
        ],
        "World `pick_station`, simulator and controller in one process. A fixed, rigid crate is put at "
        f"{PLACES} seeded places into the turn of joint 0, on the circle of the tool or inside it; median and "
        "greatest value of each row. Forces are those of the physics on rigid bodies, at each 1 ms step: an impact on "
        "a real, padded arm or on a person is another. For comparison: ISO/TS 15066:2016, table A.2, has 140 N for "
        "hands, fingers and the chest that are clamped, and twice that for a transient contact (quoted without the "
        "standard at hand: check it there). This is information, not a safety function.",
        more=[_pressing(presses)],
    )


def seeded_spots() -> list[Spot]:
    rng = np.random.default_rng(5)
    return [Spot(rng.uniform(-0.9, -0.5), rng.uniform(0.75, 1.0), rng.uniform(0.0, math.pi / 2)) for _ in range(PLACES)]


def station(kind: str, folder: Path) -> JoinedArm:
    world = JoinedWorld(with_arm_kind(load_world("pick_station"), kind), folder / kind)
    arm = world.arm()
    arm.advance(0.04)
    return arm


def hit(station: JoinedArm, kind: str, share: float, spot: Spot) -> Hit:
    arm = station.arm
    begin(station, share, spot)
    before, events = len(station.world.inspect().contacts), len(station.events)
    station.ok(command="appendPath", type="joints", data=[turned(arm, SWEEP)])
    states = station.advance(0.8 + 1.2 / (share * arm.limits.velocity[0]))
    contacts = station.world.inspect().contacts[before:]
    found = [e.info for e in station.events[events:] if e.name == "contact" and isinstance(e.info, Contact)]
    status = station.status()
    stopped = len(found) == 1 and found[0].stopped and not status["isTrajectoryRunning"]["value"]
    time = rest_after(states, contacts[0].stamp) if contacts else math.nan
    station.world.ask(Remove(name="crate"))
    q = np.array([state.q for state in station.advance(1.5)])
    station.ok(command="appendPath", type="joints", data=[turned(arm, SWEEP)])
    end = station.advance(0.8 + 1.6 / (share * arm.limits.velocity[0]))[-1]
    return Hit(
        kind,
        share,
        stopped and bool(contacts) and math.isfinite(time),
        found[0].kind if found else "",
        max((contact.force for contact in contacts), default=math.nan),
        time,
        float(np.abs(q - q[0]).max()),
        bool(np.abs(np.array(end.q) - turned(arm, SWEEP)).max() < 2e-3),
    )


def press(station: JoinedArm, spot: Spot) -> tuple[float, float, bool, float]:
    """Greatest share of a joint's torque limit that presses, the force [N] on the crate, whether the controller has
    only reported the contact, and by how much [rad] the arm moves when it is stopped and the crate goes."""
    arm = station.arm
    begin(station, 0.3, spot)
    stop_on(station, False)
    free, events = np.array(station.advance(0.1)[-1].efforts), len(station.events)
    station.ok(command="appendPath", type="joints", data=[turned(arm, SWEEP)])
    states = station.advance(4.0)[-100:]
    pressed = np.abs(np.mean([state.efforts for state in states], axis=0) - free) / arm.limits.torque
    force = force_on_crate(station)
    reported = [e.info.stopped for e in station.events[events:] if isinstance(e.info, Contact)]
    station.ask("a", True, command="softStop", priority=10)
    station.advance(1.0)
    station.world.ask(Remove(name="crate"))
    q = np.array([state.q for state in station.advance(1.5)])
    stop_on(station, True)
    return float(pressed[0]), force, reported[:1] == [False], float(np.abs(q - q[0]).max())


def begin(station: JoinedArm, share: float, spot: Spot) -> None:
    """At home, with the crate in the way."""
    arm = station.arm
    station.ok(command="resumeControl")
    station.ok(command="setProfileVelocity", type="joints", data=(0.5 * arm.limits.velocity).tolist())
    station.drive_to(arm.home)
    station.ok(command="setProfileVelocity", type="joints", data=(share * arm.limits.velocity).tolist())
    x, y, yaw = station.world.simulation.world.arms[station.name].pose
    tool = ik.forward(arm, np.array(turned(arm, spot.angle)))[:2, 3] * spot.share
    c, s = math.cos(yaw), math.sin(yaw)
    pose = Pose2(x=x + c * tool[0] - s * tool[1], y=y + s * tool[0] + c * tool[1], yaw=spot.yaw)
    station.world.ask(Place(name="crate", kind="box", pose=pose, size=(SIDE, SIDE, HEIGHT)))
    station.advance(0.2)


def stop_on(station: JoinedArm, on: bool) -> None:
    conditions = {"StopOnToleranceViolation": on}
    station.ok(command="setParameters", data={"Controller": {"StopConditions": conditions}})


def turned(arm: ik.Arm, angle: float) -> list[float]:
    return [float(arm.home[0]) + angle, *arm.home[1:].tolist()]


def rest_after(states: list[ArmState], stamp: int) -> float:
    """Seconds from ``stamp`` until the arm is at rest for good."""
    moving = [state.stamp for state in states if np.abs(state.dq).max() > AT_REST]
    return math.nan if moving[-1] == states[-1].stamp else max(moving[-1] - stamp, 0) * 1e-9


def force_on_crate(station: JoinedArm) -> float:
    """Sum of the normal forces [N] between arm and crate now."""
    simulation = station.world.simulation
    model, data = simulation.model, simulation.data
    arm, total, one = set(simulation.arms[station.name].geoms.tolist()), 0.0, np.empty(6)
    for i in range(data.ncon):
        if len(arm & set(data.contact.geom[i].tolist())) == 1:
            mujoco.mj_contactForce(model, data, i, one)
            total += float(one[0])
    return total


def _row(kind: str, share: float, hits: list[Hit]) -> tuple[str, ...]:
    def told(values: list[float], factor: float = 1.0) -> str:
        return f"{factor * float(np.median(values)):.3g} / {factor * max(values):.3g}"

    return (
        kind,
        f"{share:g}",
        f"{sum(h.stopped for h in hits)} of {len(hits)}",
        ", ".join(sorted({h.found for h in hits})),
        told([h.force for h in hits]),
        told([h.time for h in hits], 1e3),
        told([h.moved for h in hits], 1e3),
        f"{sum(h.goes_on for h in hits)} of {len(hits)}",
    )


def _pressing(presses: list[tuple[str, float, float, bool, float]]) -> Table:
    def row(kind: str) -> tuple[str, ...]:
        own = [p for p in presses if p[0] == kind]
        return (
            kind,
            f"{100 * min(p[1] for p in own):.0f} … {100 * max(p[1] for p in own):.0f}",
            f"{min(p[2] for p in own):.0f} … {max(p[2] for p in own):.0f}",
            f"{sum(p[3] for p in own)} of {len(own)}",
            f"{1e3 * max(p[4] for p in own):.2g}",
        )

    return Table(
        "With the stop condition off",
        (
            "arm",
            "torque that presses (% of the limit of joint 0)",
            "force on the crate (N)",
            "only reported",
            "moved after a stop when the crate went (mrad)",
        ),
        [row(kind) for kind in KINDS],
        "The same crates, at 0.3 of the speed, after 4 s.",
    )
