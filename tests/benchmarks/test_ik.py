"""The benchmark of inverse kinematics compares like with like: the same arm for all, and what is told is what was."""

import importlib.util

import numpy as np
import pinocchio as pin
import pytest

from benchmarks.ik.floor import Bare
from benchmarks.ik.paths import courses
from benchmarks.ik.search import Pair, search_all
from benchmarks.ik.tables import Result
from benchmarks.ik.urdf import TOOL, to_urdf
from benchmarks.ik.walk import DT, Array, Chunk, Walker
from rackhand.services.controller.ik import Arm, forward, load_arm

ARMS = [load_arm("ur5e"), load_arm("fr3")]


@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
def test_the_urdf_is_the_arm(arm: Arm) -> None:
    model = pin.buildModelFromXML(to_urdf(arm))
    floor, random = Bare(model, model.getFrameId(TOOL)), np.random.default_rng(1)
    assert list(model.names)[1:] == list(arm.joints)
    np.testing.assert_array_equal(model.lowerPositionLimit, arm.limits.lower)
    np.testing.assert_array_equal(model.upperPositionLimit, arm.limits.upper)
    np.testing.assert_array_equal(model.upperVelocityLimit, arm.limits.velocity)
    for _ in range(10):
        q = random.uniform(arm.limits.lower, arm.limits.upper)
        linear, angular = floor.distance(q, forward(arm, q))
        assert linear < 1e-12
        assert angular < 1e-6


class Scripted:
    """Does as it was told; raises where it was told None."""

    name, limits = "scripted", "none"

    def __init__(self, script: list[Array | None]) -> None:
        self.script = script

    def step(self, _q: Array, _v: Array, _now: Array, _then: Array, _twist: Array) -> Array:
        velocity = self.script.pop(0)
        if velocity is None:
            raise RuntimeError("no solution")
        return velocity


def test_what_breaks_a_limit_is_reported() -> None:
    arm = ARMS[0]
    course = courses(arm, 0.02)[0]
    still, twice = np.zeros(arm.n), 2 * arm.limits.velocity
    walker = Walker(Scripted([still, still, twice, None, *[still] * 7]), course)
    result = Result("scripted", "none", chunks=[walker.walk(0, 10)])
    speed, rate, beyond = result.keeps(arm)
    assert result.failed == 1
    assert speed == pytest.approx(2.0)
    assert rate == pytest.approx(np.max(twice / DT / arm.limits.acceleration))
    assert beyond == 0.0
    moved = forward(arm, course.start + twice * DT)[:, 3]
    assert result.errors(arm, course)[-1] == pytest.approx(1e3 * np.linalg.norm(moved - course.poses[10][:, 3]))


def test_ratios_are_of_the_same_turns() -> None:
    chunks, floor = [Chunk([4.0] * 3), Chunk([40.0] * 3)], [Chunk([2.0] * 3), Chunk([20.0] * 3)]
    assert Result("one", "none", chunks, floor, chunks).to_floor == 2.0


def test_the_rivals_search_finds_and_gives_up() -> None:
    """With the floor's step, which converges from near by; and from nowhere towards a pose out of reach."""
    arm = ARMS[0]
    floor = Bare(arm.model, arm.model.getFrameId("flange"))

    class Stepper(Bare):
        def step(self, q: Array, v: Array, now: Array, then: Array, twist: Array) -> Array:
            return np.clip(DT * super().step(q, v, now, then, twist), -0.5, 0.5)

    near, far = forward(arm, arm.home + 0.1), forward(arm, arm.home)
    far[0, 3] += 5.0
    stepper = Stepper(arm.model, floor.frame)
    found = search_all(
        stepper, floor.distance, arm.limits.lower, arm.limits.upper, [Pair(arm.home, near), Pair(arm.home, far)]
    )
    assert (found[0].reached, found[0].restarts) == (True, 0)
    assert not found[1].reached


@pytest.mark.skipif(not importlib.util.find_spec("roboplan"), reason="needs the extra bench")
@pytest.mark.parametrize("arm", ARMS, ids=lambda arm: arm.name)
def test_rivals_walk_the_nominal_course(arm: Arm) -> None:
    from benchmarks.ik.rivals import rivals

    course = courses(arm, 0.2)[0]
    for controller in rivals(arm):
        result = Result(controller.name, controller.limits, chunks=[Walker(controller, course).walk(0, 100)])
        assert result.failed == 0
        assert result.errors(arm, course)[-1] < 0.1
