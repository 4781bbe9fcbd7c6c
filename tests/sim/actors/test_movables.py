"""Racks and items that are moved, removed, restored and pushed, and racks whose legs a lidar does not see."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.refusal import RequestRefused
from rackhand.schemas.world import InjectFault, MoveObject, MoveRobot, Place, Push, Remove, Restore
from rackhand.services.sim.simulation import Simulation
from tests.sim.helpers import coast, drive, make_simulation, make_world, newest

KINDS = {"standard": {"size": (0.83, 0.83), "underside": 0.28, "height": 1.4, "mass": 90}}
LEVELS = (0.31, 0.855, 1.4)


def at(x: float, y: float, yaw: float = 0.0) -> Pose2:
    return Pose2(x=x, y=y, yaw=yaw)


def racks(**parts: Any) -> Simulation:
    """Two racks, one with a box on its middle board, a table and a chassis at the origin."""
    world = make_world(
        rack_kinds=KINDS,
        racks={"rack_1": {"kind": "standard", "pose": (2, 0, 0.3)}, "rack_2": {"kind": "standard", "pose": (2, 3, 0)}},
        items={
            "box": {"size": (0.3, 0.2, 0.1), "pose": (2.1, 0.1, 0.3), "lies_on": "rack_1", "level": 1, "mass": 8},
            "loose": {"size": (0.2, 0.2, 0.2), "pose": (-3, -3, 0)},
        },
        statics={"table": {"kind": "box", "pose": (-2, 2, 0), "size": (1, 1, 0.7)}},
        **parts,
    )
    return make_simulation(world)


def where(simulation: Simulation, name: str) -> tuple[float, ...]:
    """x, y, z and yaw."""
    thing = next(thing for thing in simulation.objects().objects if thing.name == name)
    w, x, y, z = thing.orientation
    return (*thing.position, math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def names(simulation: Simulation) -> set[str]:
    return {thing.name for thing in simulation.objects().objects}


def test_a_rack_is_moved_with_what_lies_on_it_and_comes_to_rest() -> None:
    simulation = racks()
    simulation.change(MoveObject(name="rack_1", pose=at(4.0, -2.0, 0.3 + math.pi / 2)))
    coast(simulation, 1.0)
    assert where(simulation, "rack_1") == pytest.approx((4.0, -2.0, 0.0, 0.3 + math.pi / 2), abs=1e-3)
    # The box was 0.1 to the right and 0.1 above the rack's middle, seen in the map; now both turned by 90°.
    assert where(simulation, "box") == pytest.approx((3.9, -1.9, LEVELS[1] + 0.05, 0.3 + math.pi / 2), abs=2e-3)
    assert (simulation.data.qvel == 0).sum() >= 12, "both sleep again"


def test_an_item_is_put_on_a_board_a_table_or_the_floor() -> None:
    simulation = racks()
    for lies_on, level, pose, height in (
        ("rack_2", 0, at(2.0, 3.1), LEVELS[0]),
        ("rack_2", None, at(2.2, 3.0, 1.0), LEVELS[2]),
        ("table", None, at(-2.0, 2.0), 0.7),
        (None, None, at(-4.0, -4.0), 0.0),
    ):
        simulation.change(MoveObject(name="loose", pose=pose, lies_on=lies_on, level=level))
        coast(simulation, 0.3)
        assert where(simulation, "loose") == pytest.approx((pose.x, pose.y, height + 0.1, pose.yaw), abs=2e-3)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (MoveObject(name="rack_1", pose=at(2.0, 2.5)), "'rack_1' would overlap 'rack_2' at x 2.000, y 2.500, yaw 0.0"),
        (MoveObject(name="rack_1", pose=at(0.3, 0.4)), "'rack_1' would overlap 'amr1'"),
        (MoveObject(name="rack_1", pose=at(-2.0, 1.5)), "'rack_1' would overlap 'table'"),
        (
            MoveObject(name="rack_9", pose=at(5, 5)),
            "rack or item 'rack_9' is not known; known: \\['box', 'loose', 'rack",
        ),
        (MoveObject(name="rack_1", pose=at(5, 5), lies_on="table"), "is a rack, and is put on the floor only"),
        (MoveObject(name="box", pose=at(5, 5), lies_on="table"), "x 5.000, y 5.000, yaw 0.000 is not above 'table'"),
        (MoveObject(name="box", pose=at(2, 3), lies_on="rack_2", level=3), "level 3 is not there; it has 0 … 2"),
        (MoveObject(name="box", pose=at(2, 3), lies_on="cloud"), "box or rack 'cloud' is not known"),
        (MoveObject(name="box", pose=at(2, 3), level=1), "level 1 without lies_on"),
        (MoveObject(name="rack_1", pose=at(1e9, 5)), "want x, y and yaw within"),
        (Push(name="rack_1", shift=at(-1.41, 0.855, -0.3)), "'rack_1' would overlap 'amr1'"),
        (Push(name="rack_1"), "want either shift or impulse"),
        (Push(name="amr1", impulse=(1.0, 0.0)), "'amr1' is not known"),
        (Restore(name="rack_1"), "'rack_1' was not removed; removed: \\[\\]"),
        (Remove(name="rack_9"), "placed thing, rack or item 'rack_9' is not known"),
        (InjectFault(target="rack_9", fault="leg_hidden"), "rack 'rack_9' is not known"),
        (InjectFault(target="rack_1", fault="leg_hidden", part=4), "has no part 4; it has 0 … 3"),
        (InjectFault(target="amr1", fault="lidar_dead", part=0), "has no part 0; it has none"),
    ],
)
def test_what_cannot_be_done_is_refused_and_changes_nothing(change: Any, why: str) -> None:
    simulation = racks()
    before = simulation.objects()
    with pytest.raises(RequestRefused, match=why):
        simulation.change(change)
    assert simulation.objects() == before
    coast(simulation, 0.1)
    assert where(simulation, "rack_1") == pytest.approx((2, 0, 0, 0.3), abs=1e-4)


def test_a_rack_over_a_chassis_is_no_overlap() -> None:
    simulation = racks()
    simulation.change(MoveObject(name="rack_1", pose=at(0.02, 0.01, 0.05)))
    coast(simulation, 0.5)
    assert where(simulation, "rack_1") == pytest.approx((0.02, 0.01, 0.0, 0.05), abs=1e-3)
    assert simulation.contact_log.count == 0


def test_a_removed_rack_is_neither_seen_nor_touched_nor_told_and_comes_back_with_its_load() -> None:
    simulation = racks()
    before = where(simulation, "rack_1"), where(simulation, "box")
    simulation.change(Remove(name="rack_1"))
    assert names(simulation) & {"rack_1", "box"} == set()
    drive(simulation, 5.0, linear=0.8)  # through where it was
    assert simulation.contact_log.count == 0
    with pytest.raises(RequestRefused, match="'rack_1' is not in the world now; removed: \\['rack_1'\\]"):
        simulation.change(Remove(name="rack_1"))
    with pytest.raises(RequestRefused, match="'box' is not in the world now"):
        simulation.change(Push(name="box", impulse=(1.0, 0.0)))
    simulation.change(Restore(name="rack_1"))
    coast(simulation, 0.5)
    assert where(simulation, "rack_1") == pytest.approx(before[0], abs=1e-3)
    assert where(simulation, "box") == pytest.approx(before[1], abs=1e-3)
    simulation.change(Remove(name="rack_1"))
    simulation.change(MoveObject(name="rack_1", pose=at(-3, 3)))
    assert where(simulation, "rack_1")[:2] == pytest.approx((-3, 3))
    assert {"rack_1", "box"} <= names(simulation)


def test_a_removed_rack_is_not_brought_back_into_something() -> None:
    simulation = racks()
    simulation.change(Remove(name="rack_1"))
    simulation.change(MoveRobot(robot="amr1", pose=at(1.6, 0.1)))
    with pytest.raises(RequestRefused, match=r"'rack_1' would overlap 'amr1' at x 2\.000"):
        simulation.change(Restore(name="rack_1"))
    assert "rack_1" not in names(simulation)
    simulation.change(MoveRobot(robot="amr1", pose=at(-1.0, 0.0)))
    simulation.change(Restore(name="rack_1"))
    assert "rack_1" in names(simulation)


def seen(simulation: Simulation) -> np.ndarray:
    """Hits of a scan in the map."""
    coast(simulation, 0.08)
    scan = newest(simulation, topics.SCAN)
    angles = scan.angle_min + scan.angle_step * np.arange(len(scan.ranges))
    x, y, _ = simulation.robots["amr1"].pose
    points = np.column_stack([np.cos(angles), np.sin(angles)]) * scan.ranges[:, None] + (x + scan.sensor.x, y)
    return points[np.isfinite(scan.ranges)]


def near(points: np.ndarray, x: float, y: float) -> int:
    return int((np.hypot(*(points - (x, y)).T) < 0.06).sum())


def test_a_hidden_leg_is_not_seen_but_touched() -> None:
    simulation = racks()
    leg = (2 - 0.4 * math.cos(0.3) + 0.4 * math.sin(0.3), -0.4 * math.sin(0.3) - 0.4 * math.cos(0.3))  # rear right
    other = (2 - 0.4 * math.cos(0.3) - 0.4 * math.sin(0.3), -0.4 * math.sin(0.3) + 0.4 * math.cos(0.3))
    assert near(seen(simulation), *leg) and near(seen(simulation), *other)
    simulation.change(InjectFault(target="rack_1", fault="leg_hidden", part=3))
    assert [(fault.fault, fault.target, fault.part) for fault in simulation.faults.active] == [
        ("leg_hidden", "rack_1", 3)
    ]
    assert not near(seen(simulation), *leg) and near(seen(simulation), *other)
    simulation.change(InjectFault(target="rack_1", fault="leg_hidden"))
    assert not near(seen(simulation), *other)
    simulation.change(MoveRobot(robot="amr1", pose=at(0.5, leg[1], 0.0)))
    drive(simulation, 2.0, linear=0.6)
    assert [c.other for c in simulation.contact_log.rows][:1] == ["rack_1"]
    simulation.change(MoveObject(name="rack_1", pose=at(2, -2, 0.3)))
    simulation.change(InjectFault(target="rack_1", fault="leg_hidden", active=False))
    assert simulation.faults.active == ()
    assert "rack_1" in simulation.faults.targets["rack"]
    simulation.change(MoveRobot(robot="amr1", pose=at(0.0, 0.0)))
    assert near(seen(simulation), other[0], other[1] - 2)


def test_a_shift_moves_a_rack_in_its_own_frame() -> None:
    simulation = racks()
    simulation.change(Push(name="rack_1", shift=at(0.1, -0.05, 0.02)))
    coast(simulation, 0.5)
    c, s = math.cos(0.3), math.sin(0.3)
    assert where(simulation, "rack_1") == pytest.approx((2 + 0.1 * c + 0.05 * s, 0.1 * s - 0.05 * c, 0, 0.32), abs=1e-3)


def test_an_impulse_moves_a_rack_no_further_than_friction_lets_it() -> None:
    """v = J/m = 1 m/s: friction µ = 1 alone would brake it over v²/2µg = 51 mm, and it rocks besides."""
    simulation = racks()
    simulation.change(Push(name="rack_1", impulse=(0.0, -98.0), height=0.3))
    coast(simulation, 1.5)
    x, y, z, yaw = where(simulation, "rack_1")
    assert -0.06 < y < -0.02 and (x, z, yaw) == pytest.approx((2.0, 0.0, 0.3), abs=0.01)
    assert where(simulation, "box")[2] == pytest.approx(LEVELS[1] + 0.05, abs=2e-3)


def test_an_impulse_high_up_tips_a_rack_over() -> None:
    """Work needed to lift its middle over its edge: m g (√(0.415² + h²) − h) with h = 0.73 m, some 97 J."""
    simulation = racks()
    simulation.change(Push(name="rack_2", impulse=(0.0, 90 * 2.4), height=1.35))
    coast(simulation, 2.5)
    w, x, y, _ = next(t.orientation for t in simulation.objects().objects if t.name == "rack_2")
    assert abs(1 - 2 * (x * x + y * y)) < 0.2, "its z axis lies down"
    assert w != 1.0


def test_an_obstacle_is_still_removed_by_its_name() -> None:
    simulation = racks()
    simulation.change(Place(name="crate", pose=at(5, 5)))
    simulation.change(Remove(name="crate"))
    assert "crate" not in names(simulation)
