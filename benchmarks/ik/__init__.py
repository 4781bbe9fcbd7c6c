"""Inverse kinematics beside bare pinocchio, pink, mink, roboplan and placo: time a step, limits kept, settling, poses.

    python -m benchmarks ik

All controllers walk the same courses at 500 Hz and take turns after every 50 steps, so that the machine's noise meets
all alike; ratios are medians over these turns. placo needs a pinocchio of its own and therefore walks in another
process, with the floor beside it. This file imports nothing: that process reads it too.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from benchmarks.report import Report


def run(seconds: float = 5.0, poses: int = 10_000) -> Report:
    """All tables as one report: ``seconds`` of each course, so many ``poses`` of TRAC-IK's task."""
    from benchmarks.ik.tables import report

    return report(seconds, poses)
