"""A square of the tool in physics, both arms: how far the tool is from the outline, and how fast it goes."""

from __future__ import annotations

import numpy as np

from rackhand.services.controller import ik
from tests.joined.arm import JoinedArm
from tests.joined.checks import blended, check_limits, off_line, pose, tools


def test_a_square_is_tracked(either: tuple[JoinedArm, ik.Arm]) -> None:
    """0.4 m sides at 0.25 m/s: what is driven is within 1 mm and 0.2° of the square with its corners blended."""
    station, arm = either
    start = ik.forward(arm, np.array(station.advance(0.02)[-1].q))
    station.ok(command="setProfileVelocity", type="task", data=[0.25] * 3 + [1.0] * 3)
    half = 0.2
    corners = []
    for y, z in ((half, 0.0), (half, -2 * half), (-half, -2 * half), (-half, 0.0), (0.0, 0.0)):
        corner = start.copy()
        corner[:, 3] += (0.0, y, z)
        corners.append(corner)
    station.ok(command="appendPath", type="task", data=[pose(c) for c in corners], method=2, reference=1)
    states = station.advance(9.0)
    driven = tools(states, arm)
    points = driven[:, :, 3]
    expected = blended([start[:, 3], *(c[:, 3] for c in corners)])
    off = np.array([off_line(expected, p) for p in points])
    turned = [np.degrees(np.arccos(np.clip((np.trace(start[:, :3].T @ d[:, :3]) - 1) / 2, -1, 1))) for d in driven]
    speed = np.linalg.norm(np.diff(points, axis=0), axis=1) / np.diff([s.stamp * 1e-9 for s in states])
    print(f"off by {off.max() * 1e3:.3f} mm, turned by {max(turned):.4f} deg, fastest {speed.max():.3f} m/s")
    check_limits(states, arm)
    assert off.max() <= 1e-3
    assert max(turned) <= 0.2
    assert 0.24 < speed.max() < 0.26
    assert np.linalg.norm(points[-1] - start[:, 3]) < 1e-4
    assert np.ptp(points[:, 1]) > 0.399 and np.ptp(points[:, 2]) > 0.399
