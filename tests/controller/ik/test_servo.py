"""The tick in closed loop: limits, settling, singularities, edge of reach, rows, objectives, codes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rackhand.schemas.crf import CrfCode
from rackhand.services.controller.ik import (
    Arm,
    DifferentialIk,
    ObjectiveError,
    Solver,
    SolverSettings,
    Zone,
    forward,
    load_arm,
)
from rackhand.services.controller.ik import kernels as k
from rackhand.services.controller.ik.collision import build_table, gap
from tests.controller.ik.motion import eased, follow, moved, twist_between

_ARMS = {name: load_arm(name) for name in ("ur5e", "fr3")}
_ZONES = (Zone((-0.45, 0.25, 0.3), 0.1), Zone((0.0, 0.0, 0.3), 0.8, keep_in=True))


def test_follows_a_feasible_path(arm: Arm) -> None:
    ik = DifferentialIk(arm, 0.002)
    start = ik.forward(arm.home)

    def path(t: float) -> np.ndarray:
        s = eased(t, 2.0)
        return moved(start, (0.1 * s, 0.12 * np.sin(2 * np.pi * s), -0.05 * s), (0.2 * s, 0, 0.3 * s))

    run = follow(ik, path, 2.2, arm.home)
    assert run.errors_mm().max() < 0.01
    assert not any(step.codes for step in run.steps)
    assert all(step.solver is Solver.CHOLESKY for step in run.steps)


@pytest.mark.parametrize("dt", [0.002, 0.004])
def test_settles_half_a_radian_in_half_a_second(arm: Arm, dt: float) -> None:
    """20 of 20 random steps of up to 0.5 rad a joint, to 0.1 mm and 0.05°, without leaving it again."""
    ik, random = DifferentialIk(arm, dt), np.random.default_rng(3)
    for _ in range(20):
        q = np.clip(arm.home + random.uniform(-0.3, 0.3, arm.n), arm.limits.lower + 0.05, arm.limits.upper - 0.05)
        goal = np.clip(q + random.uniform(-0.5, 0.5, arm.n), arm.limits.lower, arm.limits.upper)
        target = ik.forward(goal)
        run = follow(ik, lambda _, target=target: target, 1.5, q)
        late = run.steps[round(0.5 / dt) :]
        assert max(step.linear_error for step in late) < 1e-4
        assert max(step.angular_error for step in late) < np.deg2rad(0.05)
        assert np.max(np.abs(run.v[-1])) < 1e-6


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(sorted(_ARMS)), st.integers(0, 2**32 - 1), st.floats(0.05, 30.0), st.booleans())
def test_no_reference_breaks_a_limit(name: str, seed: int, speed: float, rows: bool) -> None:
    """Random streams, also absurdly fast and far ones that jump: ``follow`` checks every limit at every tick."""
    arm, random = _ARMS[name], np.random.default_rng(seed)
    ik = DifferentialIk(arm, 0.004)
    if rows:
        ik.set_zones(_ZONES, self_collision=True)
    for objective in ("JointLimits", "Manipulability"):
        ik.objectives.configure(objective, {"enable": bool(random.random() < 0.5)})
    start = ik.forward(arm.home)
    pull = random.normal(size=(3, 6)) * speed * np.array([0.3] * 3 + [1.0] * 3)
    jumps = np.cumsum(random.random(200) < 0.02) % 3

    def path(t: float) -> np.ndarray:
        wave = np.sin(pull[jumps[min(int(t / 0.004), 199)]] * t)
        return moved(start, 0.6 * wave[:3], 1.5 * wave[3:])

    run = follow(ik, path, 0.6, arm.home)
    assert all(np.isfinite(step.velocity).all() for step in run.steps)


def flips(velocities: list[np.ndarray], arm: Arm, dt: float) -> int:
    """How often a joint's acceleration changes sign, at a fifth of its limit or more on both sides: what chatter is."""
    rate = np.diff(np.array(velocities), axis=0) / dt / arm.limits.acceleration
    before, after = rate[:-1], rate[1:]
    return int(np.sum((before * after < 0) & (np.abs(before) > 0.2) & (np.abs(after) > 0.2)))


def test_edge_of_reach_slows_waits_and_comes_back(arm: Arm) -> None:
    """Out of reach by a third of a metre and back: stretched out meanwhile, no chatter, exact at the end."""
    ik = DifferentialIk(arm, 0.004)
    start = ik.forward(arm.home)
    out = np.append(start[:2, 3] / np.linalg.norm(start[:2, 3]), 0.0)

    def path(t: float) -> np.ndarray:
        return moved(start, 0.75 * out * (eased(t, 2.5) - eased(t - 4.5, 2.5)))

    run = follow(ik, path, 9.0, arm.home)
    waiting = slice(round(3.5 / ik.dt), round(4.5 / ik.dt))
    assert np.max(np.abs(np.array(run.v)[waiting])) < 0.02
    assert 150 < run.errors_mm()[waiting].max() < 450
    assert CrfCode.EndEffectorToleranceViolation in run.steps[round(4 / ik.dt)].codes
    assert run.errors_mm()[-100:].max() < 0.01
    assert flips(run.v, arm, ik.dt) < 40


def test_a_target_beyond_reach_is_approached_and_held(arm: Arm) -> None:
    ik = DifferentialIk(arm, 0.004)
    far = moved(ik.forward(arm.home), (3.0, 1.0, 0.5))
    run = follow(ik, lambda _: far, 6.0, arm.home)
    assert np.max(np.abs(run.v[-1])) < 0.02
    assert flips(run.v[500:], arm, ik.dt) == 0
    assert run.errors_mm()[-1] <= run.errors_mm().min() + 5.0


def test_wrist_singularity_slows_along_the_task(ur5e: Arm) -> None:
    """A straight line that brings the wrist through its singularity: 801 is said, no limit breaks, the end is exact."""
    ik = DifferentialIk(ur5e, 0.004)
    q = ur5e.home.copy()
    q[4] = -0.02
    start = ik.forward(q)
    run = follow(ik, lambda t: moved(start, (0, 0.3 * eased(t, 4.0), 0)), 6.0, q)
    assert any(CrfCode.LowManipulability in step.codes for step in run.steps)
    assert run.errors_mm()[-1] < 0.01
    assert flips(run.v, ur5e, ik.dt) < 20


def test_twist_near_a_singularity_keeps_its_direction(ur5e: Arm) -> None:
    """A twist that would need ten times the joints' speed is slowed as a whole."""
    ik = DifferentialIk(ur5e, 0.004, SolverSettings(singular_damping=0.0))
    q, v = ur5e.home.copy(), np.zeros(6)
    q[4] = -0.05
    twist = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    # Turn the axis the wrist is about to lose into the one asked for.
    frame = ik.forward(q)
    twist[3:] = frame[:, :3] @ np.array([1.0, 0.0, 0.0])
    for _ in range(40):
        step = ik.step(q, v, twist=twist)
        v = step.velocity
        before, q = ik.forward(q), q + v * ik.dt
        made = twist_between(before, ik.forward(q), ik.dt)
        assert np.linalg.norm(made - twist * (made @ twist)) < 0.02
    assert step.scale < 1.0 or np.max(np.abs(v)) < ur5e.limits.velocity.min()


def test_rows_keep_the_arm_out_of_and_in_its_zones(arm: Arm) -> None:
    """A target inside a forbidden sphere, and one outside of the permitted: no gap closes, nothing chatters."""
    ik = DifferentialIk(arm, 0.004, SolverSettings(collision_margin=0.0))
    start = ik.forward(arm.home)
    zones = [Zone(tuple(start[:, 3] + np.array([0.0, 0.25, 0.0])), 0.1), Zone((0.0, 0.0, 0.3), 0.7, keep_in=True)]
    ik.set_zones(zones, self_collision=True)
    pairs = build_table(arm, zones, self_collision=True, margin=0.0)
    frames, row = np.empty((arm.n + 1, 3, 4)), np.empty(arm.n)
    for shift in ((0.0, 0.25, 0.0), (0.0, -0.9, 0.5)):
        run = follow(ik, lambda _, shift=shift: moved(start, shift), 3.0, arm.home)
        assert any(step.solver is Solver.ROWS for step in run.steps)
        least = np.inf
        for q in run.q:
            k.forward(arm.placements, q, frames)
            least = min(least, min(gap(pair, frames, row) for pair in pairs))
        assert least > -2e-4
        assert flips(run.v[-250:], arm, ik.dt) <= 2


def test_rows_solution_is_the_box_solution_when_no_row_binds(arm: Arm) -> None:
    near, far = DifferentialIk(arm, 0.004), DifferentialIk(arm, 0.004)
    far.set_zones([Zone((9.0, 9.0, 9.0), 0.1)])
    target = moved(near.forward(arm.home), (0.1, -0.1, 0.0))
    for a, b in zip(
        follow(near, lambda _: target, 0.4, arm.home).v, follow(far, lambda _: target, 0.4, arm.home).v, strict=True
    ):
        np.testing.assert_array_equal(a, b)


def test_objectives_use_the_redundancy_and_leave_the_task(fr3: Arm) -> None:
    ik = DifferentialIk(fr3, 0.004, blend_time=0.2)
    start = ik.forward(fr3.home)
    wanted = fr3.home + np.array([0.3, 0, -0.3, 0, 0, 0, 0])
    ik.objectives.configure(
        "DesiredJointPositions", {"enable": True, "c": 2.0, "attraction": [wanted[0]] + [np.nan] * 6}
    )
    run = follow(ik, lambda _: start, 3.0, fr3.home)
    assert run.q[-1][0] - fr3.home[0] > 0.15
    assert run.errors_mm().max() < 0.05
    ik.objectives.configure("DesiredJointPositions", {"enable": False})
    assert follow(ik, lambda _: start, 0.3, run.q[-1]).errors_mm().max() < 0.05
    assert ik.objectives.state()["DesiredJointPositions"] == 0.0


def test_manipulability_is_climbed_while_the_tool_stays(fr3: Arm) -> None:
    ik = DifferentialIk(fr3, 0.004, blend_time=0.2)
    q = fr3.home + np.array([0.4, 0.0, -0.6, 0.0, 0.3, 0.0, 0.0])  # home is a maximum
    start = ik.forward(q)
    before = ik.step(q, np.zeros(7), start).manipulability
    ik.objectives.configure("Manipulability", {"enable": True, "c": 30.0})
    run = follow(ik, lambda _: start, 3.0, q)
    assert run.steps[-1].manipulability > 1.02 * before
    assert run.errors_mm().max() < 0.05


def test_an_objective_is_tuned_while_it_acts(fr3: Arm) -> None:
    """Ten times the gain draws faster, at once and without a step in acceleration beyond the limits."""
    ik = DifferentialIk(fr3, 0.004, blend_time=0.2)
    start, wanted = ik.forward(fr3.home), [fr3.home[0] + 0.5] + [np.nan] * 6
    ik.objectives.configure("DesiredJointPositions", {"enable": True, "c": 0.1, "attraction": wanted})
    slow = follow(ik, lambda _: start, 0.6, fr3.home)
    ik.objectives.configure("DesiredJointPositions", {"c": 1.0})
    fast = follow(ik, lambda _: start, 0.6, slow.q[-1])
    assert fast.q[-1][0] - fast.q[0][0] > 4 * (slow.q[-1][0] - slow.q[0][0]) > 0


@pytest.mark.parametrize(
    ("name", "parameters", "says"),
    [
        ("Gravity", {}, "expected one of DesiredJointPositions"),
        ("JointLimits", {"q": 1}, "no parameter 'q'"),
        ("JointLimits", {"c": "fast"}, "must be of numbers"),
        ("JointLimits", {"c": -1}, "must not be negative"),
        ("JointLimits", {"p": float("nan")}, "finite"),
        ("JointLimits", {"enable": 1}, "true or false"),
        ("DesiredJointPositions", {"attraction": [0.0]}, "must be"),
        ("CollisionAvoidanceSphere", {"center": [0, 0, float("inf")]}, "finite"),
    ],
)
def test_bad_objective_parameters_change_nothing(ur5e: Arm, name: str, parameters: dict, says: str) -> None:
    objectives = DifferentialIk(ur5e, 0.004).objectives
    with pytest.raises(ObjectiveError, match=says):
        objectives.configure(name, {"enable": True} | parameters if "enable" not in parameters else parameters)
    assert not objectives.advance(1.0)


def test_input_that_is_not_finite_brakes(arm: Arm) -> None:
    ik = DifferentialIk(arm, 0.004)
    target = np.full((3, 4), np.nan)
    v = 0.5 * arm.limits.velocity
    step = ik.step(arm.home, v, target)
    assert step.codes == (CrfCode.WorkspaceViolation,)
    assert step.solver is Solver.NONE
    np.testing.assert_allclose(step.velocity, v - arm.limits.acceleration * ik.dt)
    assert ik.step(arm.home, step.velocity, forward(arm, arm.home)).solver is not Solver.NONE


def test_driven_into_a_zone_it_brakes_and_says_so(ur5e: Arm) -> None:
    ik = DifferentialIk(ur5e, 0.004)
    here = ik.forward(ur5e.home)
    ik.set_zones([Zone(tuple(here[:, 3] + np.array([0, 0.16, 0])), 0.09)])
    v = np.array([-1.0, 0, 0, 0, 0, 0])
    v *= np.sign((ik.forward(ur5e.home + 0.01 * v)[:, 3] - here[:, 3])[1])
    step = ik.step(ur5e.home, v, moved(here, (0, 0.3, 0)))
    assert CrfCode.WorkspaceViolation in step.codes
    assert abs(step.velocity[0]) < 1.0


@pytest.mark.parametrize("dt", [0.0, -0.1, 1.0, float("nan")])
def test_bad_period(ur5e: Arm, dt: float) -> None:
    with pytest.raises(ValueError, match="dt must be"):
        DifferentialIk(ur5e, dt)
