from __future__ import annotations

from rackhand.services.launch.restarts import GiveUp, History, RestartPolicy, after_exit

POLICY = RestartPolicy(first_delay=0.5, longest_delay=10.0, healthy_after=30.0, attempts=6)
ONCE_HEALTHY = History(failures=0, was_healthy=True)


def delays(history: History, lifetimes: list[float]) -> list[float]:
    found = []
    for ran_for in lifetimes:
        history, verdict = after_exit(POLICY, history, ran_for, 1)
        assert isinstance(verdict, float)
        found.append(verdict)
    return found


def test_delay_doubles_up_to_the_longest() -> None:
    assert delays(ONCE_HEALTHY, [0.1] * 8) == [0.5, 1, 2, 4, 8, 10, 10, 10]


def test_a_healthy_run_is_reset() -> None:
    assert delays(ONCE_HEALTHY, [0.1, 0.1, 29.9, 30.0, 0.1]) == [0.5, 1, 2, 0.5, 1]


def test_many_failures_do_not_overflow() -> None:
    _, verdict = after_exit(POLICY, History(5000, was_healthy=True), 0.1, -9)
    assert verdict == 10.0


def test_what_never_was_healthy_is_given_up_after_the_last_attempt() -> None:
    history = History()
    for _ in range(POLICY.attempts - 1):
        history, verdict = after_exit(POLICY, history, 0.1, 1)
        assert isinstance(verdict, float)
    _, verdict = after_exit(POLICY, history, 0.1, 1)
    assert isinstance(verdict, GiveUp)
    assert "6 times" in verdict.why


def test_a_wrong_command_line_is_given_up_at_once() -> None:
    for code in (2, 126, 127):
        _, verdict = after_exit(POLICY, History(), 0.1, code)
        assert isinstance(verdict, GiveUp)


def test_a_wrong_command_line_after_health_is_tried_again() -> None:
    _, verdict = after_exit(POLICY, ONCE_HEALTHY, 0.1, 2)
    assert verdict == 0.5


def test_what_is_killed_from_outside_is_started_again_however_often() -> None:
    history = History()
    for _ in range(3 * POLICY.attempts):
        history, verdict = after_exit(POLICY, history, 5.0, -9)
        assert isinstance(verdict, float)
    assert verdict == POLICY.longest_delay
