from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from rackhand.schemas.base import Twist2
from rackhand.services.planner.control import mppi
from rackhand.services.planner.control.mppi import BodyFrame, CostField, Drive, Mppi, MppiProblem
from rackhand.services.planner.geometry.cells import Geometry
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.planning.cost_to_go import cost_to_go
from rackhand.services.planner.planning.distance_grid import DistanceGrid
from rackhand.services.planner.planning.inflation import Inflation
from rackhand.services.planner.settings import Limits, MppiCosts, MppiSettings, NavigationSettings
from tests.planner.plant import BODY

S = NavigationSettings(mppi=MppiSettings(samples=300))
FOOTPRINT = Footprint.of(BODY)
LIMITS = Limits()
START, GOAL = np.array([2.0, 3.0, 0.0]), np.array([8.0, 3.0, 0.0])
NOBODY = np.empty((0, 5))


@pytest.fixture(scope="module")
def hall() -> tuple[DistanceGrid, CostField]:
    """10 x 6 m, walls around."""
    blocked = np.zeros((120, 200), dtype=np.bool_)
    blocked[[0, -1]] = blocked[:, [0, -1]] = True
    grid = DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.05, 120, 200))
    row, column = grid.geometry.cell(GOAL[0], GOAL[1])
    cost, _, _ = cost_to_go(grid, row, column, Inflation(FOOTPRINT.inscribed, 0.5, 4.0), 10**6)
    return grid, CostField(cost, grid.geometry)


def drive(
    hall: tuple[DistanceGrid, CostField], obstacle: np.ndarray | None, ticks: int, settings: NavigationSettings = S
) -> list[tuple[np.ndarray, float]]:
    """Poses and the gap to the obstacle (infinite for none) of a chassis that follows its commands with a lag."""
    controller, pose, last, measured, seen = Mppi(settings), START.copy(), (0.0, 0.0), np.zeros(2), []
    for k in range(ticks):
        now = NOBODY if obstacle is None else obstacle + np.array([*obstacle[2:4], 0, 0, 0]) * 0.04 * k
        command = controller.command(
            pose, Twist2(linear=measured[0], angular=measured[1]), Twist2(linear=last[0], angular=last[1]), hall[0],
            hall[1], GOAL, now.reshape(-1, 5), FOOTPRINT, math.inf,
        )  # fmt: skip
        last = command.linear, command.angular
        measured = measured + (np.array(last) - measured) * 0.33
        pose = pose + 0.04 * np.array([measured[0] * math.cos(pose[2]), measured[0] * math.sin(pose[2]), measured[1]])
        gap = math.inf
        if obstacle is not None:
            c, s = math.cos(pose[2]), math.sin(pose[2])
            dx, dy = now[0] - pose[0], now[1] - pose[1]
            outside = np.maximum(np.abs([c * dx + s * dy, -s * dx + c * dy]) - (0.375, 0.23), 0.0)
            gap = float(np.hypot(*outside)) - now[4]
        seen.append((pose, gap))
    return seen


def test_drives_to_the_goal_where_nothing_moves(hall: tuple[DistanceGrid, CostField]) -> None:
    poses = [pose for pose, _ in drive(hall, None, 75)]
    assert poses[-1][0] > 3.5 and abs(poses[-1][1] - 3.0) < 0.3


def test_keeps_clear_of_somebody_who_comes_head_on(hall: tuple[DistanceGrid, CostField]) -> None:
    seen = drive(hall, np.array([6.0, 3.0, -0.8, 0.0, 0.3]), 100)
    assert min(gap for _, gap in seen) > 0.05


def test_the_same_inputs_give_the_same_commands(hall: tuple[DistanceGrid, CostField]) -> None:
    walker = np.array([6.0, 3.0, -0.8, 0.0, 0.3])
    one, other = (drive(hall, walker, 10) for _ in range(2))
    assert all(np.array_equal(a, b) for (a, _), (b, _) in zip(one, other, strict=True))


def test_whole_numbers_among_the_settings_do_not_recompile(hall: tuple[DistanceGrid, CostField]) -> None:
    drive(hall, None, 1)
    before = len(mppi.rollouts.signatures) if hasattr(mppi.rollouts, "signatures") else 0
    whole = replace(S, control=Limits(1, -1, 1, -2, 1, 1), mppi=MppiSettings(samples=300, costs=MppiCosts(400, 1)))
    drive(hall, None, 1, whole)
    assert (len(mppi.rollouts.signatures) if hasattr(mppi.rollouts, "signatures") else 0) == before


def test_rollouts_keep_the_limits_and_the_first_two_are_the_plan_and_a_stop(
    hall: tuple[DistanceGrid, CostField],
) -> None:
    problem = in_hall(hall)
    plan = np.tile([0.6, 0.1], (32, 1))
    noise = np.random.default_rng(1).normal(0.0, 0.5, (200, 32, 2))
    start = np.array([*START, 0.6, 0.1, 0.6, 0.1])
    costs, commands = mppi.rollouts(problem, plan, noise, start)
    assert costs.shape == (200,) and commands.shape == (200, 32, 2) and np.isfinite(costs).all()
    assert commands[0] == pytest.approx(plan)
    assert commands[1, -1] == pytest.approx([0.0, 0.0])
    assert commands[..., 0].min() >= LIMITS.max_backward_velocity - 1e-9
    assert commands[..., 0].max() <= LIMITS.max_forward_velocity + 1e-9
    assert np.abs(np.diff(commands[..., 1], axis=1)).max() <= LIMITS.max_angular_acc * 0.12 + 1e-9


def test_no_rollout_bends_faster_than_the_limit(hall: tuple[DistanceGrid, CostField]) -> None:
    plan = np.tile([1.0, 0.3], (32, 1))
    noise = np.random.default_rng(1).normal(0.0, 1.0, (300, 32, 2))
    _, commands = mppi.rollouts(in_hall(hall), plan, noise, np.array([*START, 1.0, 0.3, 1.0, 0.3]))
    lateral = np.abs(commands[..., 0] * commands[..., 1])
    assert 0.95 * S.max_lateral_acc < lateral.max() <= S.max_lateral_acc + 1e-9
    assert np.abs(np.diff(commands[..., 1], axis=1)).max() <= LIMITS.max_angular_acc * 0.12 + 1e-9


def test_what_is_too_fast_for_its_bend_is_driven_slower_on_the_same_arc() -> None:
    v, w = mppi.slower_in_bends(-1.2, 1.0, 0.6)
    assert (v * w, w / v) == pytest.approx((-0.6, -1.0 / 1.2))
    assert mppi.slower_in_bends(1.0, 0.5, 0.6) == (1.0, 0.5)


def in_hall(hall: tuple[DistanceGrid, CostField]) -> MppiProblem:
    """Nobody there, to the goal."""
    model = Drive(0.12, 0.1, LIMITS, S.max_lateral_acc)
    return MppiProblem(model, hall[0], hall[1], GOAL, NOBODY, FOOTPRINT.edges, mppi.body_discs(FOOTPRINT), MppiCosts())


def test_primitives_turn_to_their_bearing_and_drive_for_their_time() -> None:
    east = 24 - mppi.FIRST_PRIMITIVE  # bearing of 360 degrees
    assert mppi.primitive(east, 0.5, 0.0, LIMITS) == pytest.approx((1.2, 0.0), abs=1e-9)
    v, w = mppi.primitive(east, 0.5, -1.0, LIMITS)
    assert v == pytest.approx(1.2 * math.cos(1.0) ** 2) and w == pytest.approx(mppi.TURN_GAIN)
    first = (24 + 1) - mppi.FIRST_PRIMITIVE  # of policy 0 and 1 the last and the first
    assert mppi.primitive(21, 1.3, math.radians(345), LIMITS)[0] == 0.0
    assert mppi.primitive(first + 1, 2.3, 0.0, LIMITS)[0] > 0.0
    assert mppi.primitive(3 * 24, 9.0, math.radians(30), LIMITS)[0] == pytest.approx(LIMITS.max_backward_velocity)


def test_discs_cover_the_body_and_their_clearance_is_to_a_cell() -> None:
    discs = mppi.body_discs(FOOTPRINT)
    for corner in BODY:
        assert (np.hypot(discs[:, 0] - corner[0], corner[1]) <= discs[:, 1] + 1e-9).any()
    blocked = np.zeros((80, 80), dtype=np.bool_)
    blocked[:, 60:] = True  # from x = 3
    grid = DistanceGrid.of(blocked, Geometry(0.0, 0.0, 0.05, 80, 80))
    reach = float((discs[:, 0] + discs[:, 1]).max())
    free = mppi.disc_clearance(grid, discs, BodyFrame(2.0, 2.0, 1.0, 0.0))
    assert free == pytest.approx(1.0 - reach, abs=0.06)
    assert mppi.disc_clearance(grid, discs, BodyFrame(-1.0, 2.0, 1.0, 0.0)) < 0.0


def test_an_obstacle_moves_grows_and_is_infinitely_far_out_of_range() -> None:
    obstacles, costs, body = np.array([(2.0, 0.0, -0.5, 0.0, 0.3)]), MppiCosts(), BodyFrame(0.0, 0.0, 1.0, 0.0)
    assert mppi.obstacle_clearance(obstacles, 0, 0.0, FOOTPRINT.edges, body, costs) == pytest.approx(2 - 0.375 - 0.3)
    later = mppi.obstacle_clearance(obstacles, 0, 1.0, FOOTPRINT.edges, body, costs)
    assert later == pytest.approx(1.5 - 0.375 - 0.3 - costs.dynamic_growth)
    turned = BodyFrame(0.0, 0.0, 0.0, 1.0)
    assert mppi.obstacle_clearance(obstacles, 0, 0.0, FOOTPRINT.edges, turned, costs) == pytest.approx(2 - 0.23 - 0.3)
    assert mppi.obstacle_clearance(obstacles + 1.0, 0, 0.0, FOOTPRINT.edges, body, costs) == math.inf
