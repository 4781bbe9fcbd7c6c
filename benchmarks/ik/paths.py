"""The courses that controllers walk: nominal, to the edge of reach, too fast, through the wrist's singularity."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pinocchio as pin

from benchmarks.ik.walk import DT, Array, Course
from rackhand.services.controller.ik import Arm, forward

Path = Callable[[float], Array]  # time [s] → pose of the tool (3, 4)
TURN = 2 * np.pi / 5.0
# The joint that, at this position, lines up two axes of the wrist; courses through that begin close to it.
WRIST = {"ur5e": (4, 0.0), "fr3": (5, np.pi)}


def courses(arm: Arm, seconds: float) -> list[Course]:
    """All four, each at rest at its start."""
    bent = arm.home.copy()
    joint, singular = WRIST[arm.name]
    bent[joint] = singular - 0.02
    start, wrist = forward(arm, arm.home), forward(arm, bent)
    out = np.append(start[:2, 3] / np.linalg.norm(start[:2, 3]), 0.0)

    def nominal(t: float) -> Array:
        s = eased(t)
        return moved(start, (0.1 * s, 0.12 * np.sin(TURN * s), -0.05 * s), (0.2 * s, 0, 0.3 * s))

    def edge(t: float) -> Array:
        return moved(start, 0.75 * eased(t) * out)

    def fast(t: float) -> Array:
        a, b = np.sin(5 * TURN * t), np.sin(7 * TURN * t)
        return moved(start, (0.2 * a, 0.25 * b, 0.1 * a), (0.8 * b, 0, 0.8 * a))

    def through_wrist(t: float) -> Array:
        return moved(wrist, (0.0, 0.3 * eased(t), 0.0))

    paths = {"nominal": (arm.home, nominal), "edge": (arm.home, edge), "fast": (arm.home, fast)}
    paths["wrist"] = (bent, through_wrist)
    return [course(label, q, path, round(seconds / DT)) for label, (q, path) in paths.items()]


def course(label: str, start: Array, path: Path, steps: int) -> Course:
    """The path in so many steps."""
    poses = np.array([path(i * DT) for i in range(steps + 1)])
    turns = np.array([pin.log3(b[:, :3] @ a[:, :3].T) for a, b in itertools.pairwise(poses)])
    return Course(label, start, poses, np.hstack([np.diff(poses[:, :, 3], axis=0), turns]) / DT)


def moved(pose: Array, shift: tuple[float, ...] | Array, turn: tuple[float, ...] = (0, 0, 0)) -> Array:
    """The pose shifted and turned about its own origin, both in base axes."""
    return np.hstack([pin.exp3(np.array(turn, float)) @ pose[:, :3], (pose[:, 3] + np.array(shift, float))[:, None]])


def eased(t: float) -> float:
    """0 → 1 → 0 in 5 s, at rest at the ends."""
    return float(0.5 - 0.5 * np.cos(TURN * t))
