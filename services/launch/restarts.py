"""When a process that ended is started again. Values in, values out."""

from __future__ import annotations

import signal
from dataclasses import dataclass

# A shell's codes for "found but not executable" and "not found", and the usual one for a wrong command line:
# the same command would end the same way again.
HOPELESS_CODES = frozenset({2, 126, 127})


@dataclass(frozen=True)
class RestartPolicy:
    """Wait ``first_delay`` before the first restart, twice as long before each next one, never over ``longest_delay``.

    After ``healthy_after`` seconds of running, the count starts again. A process that never ran that long and has ended
    ``attempts`` times is given up: it cannot start. One that was killed from outside could. All in seconds.
    """

    first_delay: float = 0.5
    longest_delay: float = 10.0
    healthy_after: float = 30.0
    attempts: int = 6


@dataclass(frozen=True)
class History:
    """What is known of one process: how often in a row it ended early, and whether it ever was healthy."""

    failures: int = 0
    was_healthy: bool = False


@dataclass(frozen=True)
class GiveUp:
    """The process can never start; ``why`` is for the user."""

    why: str


def after_exit(policy: RestartPolicy, history: History, ran_for: float, code: int) -> tuple[History, float | GiveUp]:
    """The new history, and the seconds to wait before the next start, or ``GiveUp``.

    ``code`` is the exit code as Python reports it: negative for a signal.
    """
    healthy = ran_for >= policy.healthy_after
    history = History(1 if healthy else history.failures + 1, history.was_healthy or healthy)
    if not history.was_healthy:
        if code in HOPELESS_CODES:
            return history, GiveUp(f"it was started with wrong options (exit code {code})")
        if history.failures >= policy.attempts and code != -signal.SIGKILL:
            return history, GiveUp(f"it ended {history.failures} times without running for {policy.healthy_after:g} s")
    doublings = min(history.failures - 1, 30)
    return history, min(policy.first_delay * 2.0**doublings, policy.longest_delay)
