"""The paths that controllers walk: time [s] → pose of the tool (3, 4)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from services.controller.ik import Arm, forward

Array = NDArray[np.float64]
Path = Callable[[float], Array]
DT = 0.002
TURN = 2 * np.pi / 5.0


def moved(pose: Array, shift: tuple[float, ...] | Array, turn: tuple[float, ...] = (0, 0, 0)) -> Array:
    """The pose shifted and turned about its own origin, both in base axes."""
    return np.hstack([pin.exp3(np.array(turn, float)) @ pose[:, :3], (pose[:, 3] + np.array(shift, float))[:, None]])


def eased(t: float) -> float:
    """0 → 1 → 0 in 5 s, at rest at the ends."""
    return float(0.5 - 0.5 * np.cos(TURN * t))


def PATHS(arm: Arm) -> list[tuple[str, Array, Path]]:  # noqa: N802
    """Name, start and path of each."""
    start = forward(arm, arm.home)
    out = np.append(start[:2, 3] / np.linalg.norm(start[:2, 3]), 0.0)

    def nominal(t: float) -> Array:
        s = eased(t)
        return moved(start, (0.1 * s, 0.12 * np.sin(TURN * s), -0.05 * s), (0.2 * s, 0, 0.3 * s))

    def edge(t: float) -> Array:
        return moved(start, 0.75 * eased(t) * out)

    def fast(t: float) -> Array:
        a, b = np.sin(5 * TURN * t), np.sin(7 * TURN * t)
        return moved(start, (0.2 * a, 0.25 * b, 0.1 * a), (0.8 * b, 0, 0.8 * a))

    found = [("nominal", arm.home, nominal), ("edge", arm.home, edge), ("fast", arm.home, fast)]
    if arm.name == "ur5e":
        bent = arm.home.copy()
        bent[4] = -0.02
        wrist = forward(arm, bent)
        found.append(("wrist", bent, lambda t: moved(wrist, (0.0, 0.3 * eased(t), 0.0))))
    return found
