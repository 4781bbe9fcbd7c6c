"""Waypoints appended to a motion under way: only the part after its last corner is planned again.

The corner at the old end is blended as far as the leg before it is not driven yet. Where that is too late, the old
path is finished and the corner is passed at rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rackhand.services.controller.trajectory.continuation import Continuation, follow
from rackhand.services.controller.trajectory.curve import JointCurve
from rackhand.services.controller.trajectory.geometry import JointPath, Legs, TaskPath, Tolerance
from rackhand.services.controller.trajectory.model import Kinematics
from rackhand.services.controller.trajectory.stream import Motion, PathLimits
from rackhand.services.controller.trajectory.timing import PathConstraints, plan, rows


def extend_joints(
    motion: Motion,
    t: float,
    more: JointPath,
    tolerance: Tolerance,
    limits: PathLimits,
    kinematics: Kinematics | None = None,
) -> Motion:
    """``motion``, from ``t`` on driving ``more`` too, a joint path that begins where that of ``motion`` ends.

    ``limits`` hold for the new part. ``kinematics`` is needed with task limits only.
    """
    motion = _trimmed(motion, t)
    old = motion.path
    if not isinstance(old, JointPath):
        raise TypeError("joint waypoints do not extend a task path")

    def spliced(free: float) -> tuple[Motion, bool]:
        path = old.extended(more, tolerance, free)
        begin, stop = _corner(path.legs, old.legs)
        curve = path.curve()
        tail = curve.from_(begin)
        lines = rows(tail, limits.joints, motion.planning, limits.task, None, kinematics)
        return _driven(replace(motion, path=path, curve=curve, rows=_joined(motion.rows, lines, stop)), t)

    return _first_feasible(spliced(free) for free in (_free(motion, t), 0.0))


def extend_task(
    motion: Motion,
    t: float,
    more: TaskPath,
    tolerance: Tolerance,
    limits: PathLimits,
    kinematics: Kinematics,
    options: Continuation | None = None,
) -> Motion:
    """As ``extend_joints``, for task paths. Raises ``PathRefused`` with the numbers of ``more`` without its first."""
    motion = _trimmed(motion, t)
    old = motion.path
    if not isinstance(old, TaskPath):
        raise TypeError("task waypoints do not extend a joint path")

    def spliced(free: float) -> tuple[Motion, bool]:
        path = old.extended(more, tolerance, free)
        begin, stop = _corner(path.legs, old.legs)
        here = motion.curve.derivatives(np.array([begin]), left=True)[:3]
        tail = follow(kinematics, limits.joints, path, here[0, 0], begin, 1 - old.legs.s.size, options)
        if not stop:
            # Where both meet, the derivatives that are already driven count, so that the curve stays smooth.
            first = (np.concatenate([now, column[1:]]) for now, column in zip(here, _columns(tail), strict=True))
            tail = JointCurve(tail.s, *first)
        lines = rows(tail, limits.joints, motion.planning, limits.task, path, kinematics)
        joined = _joined(motion.rows, lines, stop)
        return _driven(replace(motion, path=path, curve=motion.curve.joined(tail, stop), rows=joined), t)

    return _first_feasible(spliced(free) for free in (_free(motion, t), 0.0))


def _trimmed(motion: Motion, t: float) -> Motion:
    """Without what the filter has passed at ``t``: a queue that is appended to for hours stays small."""
    passed = motion.law.at(t - motion.planning.smoothing.total)[0]
    return replace(
        motion,
        path=motion.path.from_(passed),
        curve=motion.curve.from_(passed),
        rows=motion.rows.between(passed),
        law=motion.law,
    )


def _free(motion: Motion, t: float) -> float:
    """How much of the path is still to be planned at ``t``."""
    return motion.curve.end - motion.law.at(t)[0]


def _corner(new: Legs, old: Legs) -> tuple[float, bool]:
    """Where the path begins to be a new one, and whether the old one is finished first."""
    corner = old.s.size - 1
    return float(new.s[corner] - new.radius[corner]), bool(new.stop[corner])


def _joined(old: PathConstraints, tail: PathConstraints, stop: bool) -> PathConstraints:
    if not stop:
        return old.between(float(old.s[0]), float(tail.s[0]) - 1e-9).joined(tail)
    joined = old.joined(tail)
    joined.rest[old.s.size - 1 : old.s.size + 1] = 1.0
    return joined


def _driven(motion: Motion, t: float) -> tuple[Motion, bool]:
    timed = plan(motion.curve, motion.rows, motion.planning, motion.until(t), motion.rate)
    return motion.driven(timed), timed.feasible and max(timed.use) <= 1 + 5 * motion.planning.slack


def _first_feasible(tries: Iterator[tuple[Motion, bool]]) -> Motion:
    """Finishing the old path first is the last try, and always possible."""
    motion, feasible = next(tries)
    while not feasible:
        motion, feasible = next(tries, (motion, True))
    return motion


def _columns(curve: JointCurve) -> tuple[np.ndarray, ...]:
    return curve.q, curve.dq, curve.ddq
