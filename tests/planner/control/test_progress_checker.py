from __future__ import annotations

import pytest

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.services.planner.control.progress_checker import ProgressWatch, RestWatch
from rackhand.services.planner.errors import MoveFailed
from rackhand.services.planner.settings import NavigationSettings

S = NavigationSettings()
SECOND = 10**9


def test_only_progress_resets_the_time() -> None:
    watch = ProgressWatch(S, 0)
    watch.update(1 * SECOND, "path", 5.0)
    watch.update(2 * SECOND, "path", 4.97)  # less than counts
    assert watch.standing(3 * SECOND) == 3.0
    watch.update(3 * SECOND, "path", 4.9)
    assert watch.standing(5 * SECOND) == 2.0
    watch.update(6 * SECOND, "path", 7.0)
    assert watch.standing(6 * SECOND) == 3.0


def test_another_measure_starts_from_its_own_value_but_does_not_reset_the_time() -> None:
    watch = ProgressWatch(S, 0)
    watch.update(0, "path", 0.1)
    watch.update(2 * SECOND, "turn", 3.0)
    assert watch.standing(2 * SECOND) == 2.0
    watch.update(3 * SECOND, "turn", 2.9)
    assert watch.standing(3 * SECOND) == 0.0
    watch.renew()
    watch.update(4 * SECOND, "turn", 9.0)
    watch.update(5 * SECOND, "turn", 8.9)
    assert watch.standing(5 * SECOND) == 0.0


@pytest.mark.parametrize(("phase", "state"), [("driving", "move_stucked"), ("rotating", "target_spin_stucked")])
def test_stuck_after_a_while(phase: str, state: str) -> None:
    watch = ProgressWatch(S, 0)
    assert watch.stuck_state(int((S.stuck_after - 0.1) * SECOND), phase) == "none"
    assert watch.stuck_state(int((S.stuck_after + 0.1) * SECOND), phase) == state
    watch.restart(10 * SECOND)
    assert watch.stuck_state(10 * SECOND, phase) == "none"


def test_fails_with_what_is_in_the_way() -> None:
    watch = ProgressWatch(S, 0)
    watch.check(60 * SECOND, "driving", "x")
    with pytest.raises(MoveFailed) as failed:
        watch.check(61 * SECOND, "driving", "blocked by an obstacle")
    assert failed.value.reason is MoveFailReason.MOVE_TIMEOUT
    assert failed.value.text == "path exists, no progress for 61 s: blocked by an obstacle"
    with pytest.raises(MoveFailed) as failed:
        watch.check(31 * SECOND, "rotating", "the chassis does not follow")
    assert failed.value.reason is MoveFailReason.ROTATE_TIMEOUT
    assert failed.value.text == "no progress of the turn for 31 s: the chassis does not follow"
    watch.check(119 * SECOND, "planning", "x")


@pytest.mark.parametrize("longest", [1.0, 9.6, 30.0])
def test_to_and_fro_does_not_go_on_for_ever(longest: float) -> None:
    """Half a metre is lost and made good again, over and over."""
    watch, ended = ProgressWatch(S, 0), None
    for k in range(3000):
        watch.renew()
        for left in (longest, longest - 0.5):
            watch.update(k * SECOND, "path", left)
        assert watch.standing(k * SECOND) == 0.0
        try:
            watch.check(k * SECOND, "driving", "x")
        except MoveFailed as failed:
            assert failed.reason is MoveFailReason.MOVE_TIMEOUT and "not arrived after" in failed.text
            ended = k
            break
    assert ended is not None and 120 + 9 * longest < ended < 123 + 10 * longest


def test_a_hold_does_not_count() -> None:
    watch = ProgressWatch(S, 0)
    watch.update(0, "path", 1.0)
    watch.restart(500 * SECOND)
    watch.check(501 * SECOND, "driving", "x")


def test_a_place_is_left_after_a_centimetre_and_the_time_of_a_hold_does_not_count() -> None:
    watch = RestWatch(0)
    assert watch.update(0, 1.0, 2.0)
    assert not watch.update(5 * SECOND, 1.004, 2.008)
    assert watch.standing(5 * SECOND) == 5.0
    assert watch.update(6 * SECOND, 1.008, 2.008) and watch.standing(6 * SECOND) == 0.0
    watch.restart(9 * SECOND)
    assert watch.standing(10 * SECOND) == 1.0
