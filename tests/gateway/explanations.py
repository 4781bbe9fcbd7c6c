"""An explanation as a planner gives it, for tests of what shows it."""

from __future__ import annotations

import numpy as np

from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Costmap
from rackhand.schemas.explain import Evidence, Explanation, Held, Measure, PastPath, Thing
from rackhand.schemas.moves import Move


def explanation() -> Explanation:
    """Of a move that a wall stopped."""
    move = Move(id=1, type="standard", state="failed", create_time=0, last_modified_time=0, fail_reason=15)
    wall = Thing(
        role="blocks",
        kind="virtual wall",
        name="north",
        x=3.0,
        y=1.5,
        clearance=-0.05,
        needed=0.05,
        at=Pose2(x=2.5, y=1.5, yaw=0.0),
    )
    return Explanation(
        stamp=20_000_000_000,
        move=move,
        verdict="failed",
        cause="path exists, no progress for 15 s; virtual wall 'north' at (3.00, 1.50)",
        advice="remove what blocks the way, then post the move again",
        evidence=Evidence(things=(wall,), measures=(Measure(name="time", value=15.1, expected=15.0, unit="s"),)),
        held=(Held(by="an obstacle", seconds=15.0),),
        duration=20.0,
        driven=1.5,
        pose=Pose2(x=2.0, y=1.5, yaw=0.0),
        footprint=np.array([[2.3, 1.2], [2.3, 1.8], [1.7, 1.8], [1.7, 1.2]], dtype=np.float32),
        trace=np.array([[-0.04, 1.99, 1.5, 0.0, 0.5, 0.0, 0.4, 0.1], [0.0, 2.0, 1.5, 0.0, 0.4, 0.0, 0.3, 0.0]], "<f4"),
        paths=(PastPath(stamp=15_000_000_000, poses=np.array([[2.0, 1.5, 0.0], [4.0, 1.5, 0.0]], "<f4")),),
        costmap=Costmap(
            stamp=20_000_000_000, origin=(1.0, 0.5), resolution=0.05, columns=3, cost=np.arange(6, dtype="|u1")
        ),
    )
