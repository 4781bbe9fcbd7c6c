"""A service that stands back is nice; one that wakes promptly has short slices; a control loop is in real time.

Those are read back from Linux: how long a wake-up takes depends on the machine.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Callable

import pytest

from rackhand.runtime import priority
from rackhand.runtime.priority import SLICE_NS, run_in_real_time, set_short_slice
from tests.scheduling import IN_REAL_TIME, grants_real_time, heeded, in_thread, on_linux, slice_and_nice
from tests.system.cell import ROOT


def test_a_higher_niceness_gives_a_smaller_share() -> None:
    ask = "import os; from rackhand.runtime.priority import set_niceness; set_niceness(7); print(os.nice(0))"
    told = subprocess.run([sys.executable, "-c", ask], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert int(told) == min(os.nice(0) + 7, 19)


@heeded
def test_the_thread_and_those_it_starts_have_short_slices_and_others_keep_theirs() -> None:
    before, nice = slice_and_nice()

    def ask() -> tuple[bool, tuple[int, int], object]:
        return set_short_slice(), slice_and_nice(), in_thread(slice_and_nice)

    assert before > SLICE_NS
    assert in_thread(ask) == (True, (SLICE_NS, nice), (SLICE_NS, nice))
    assert slice_and_nice() == (before, nice)


@heeded
def test_what_is_nice_stays_so() -> None:
    def ask() -> tuple[bool, tuple[int, int]]:
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), 7)
        return set_short_slice(), slice_and_nice()

    assert in_thread(ask) == (True, (SLICE_NS, 7))


@heeded
def test_a_policy_somebody_chose_stays() -> None:
    def ask() -> tuple[bool, int]:
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        return set_short_slice(), os.sched_getscheduler(0)

    assert in_thread(ask) == (False, os.SCHED_BATCH)


def test_where_nothing_can_be_asked_nothing_is(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(priority.platform, "machine", lambda: "unheard-of")
    assert set_short_slice() is False


@grants_real_time
def test_the_thread_is_in_real_time_and_what_it_starts_is_not() -> None:
    def ask() -> tuple[bool, int, object]:
        return run_in_real_time(), os.sched_getscheduler(0), in_thread(lambda: os.sched_getscheduler(0))

    assert in_thread(ask) == (True, IN_REAL_TIME, os.SCHED_OTHER)
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


@on_linux
def test_without_the_right_to_it_all_stays_as_it_is() -> None:
    ask = (
        "import os, resource; from rackhand.runtime.priority import run_in_real_time\n"
        "resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))\n"
        "if os.geteuid() == 0: os.setuid(65534)\n"
        "print(run_in_real_time(), os.sched_getscheduler(0) == os.SCHED_OTHER)"
    )
    told = subprocess.run([sys.executable, "-c", ask], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert told.split() == ["False", "True"]


@on_linux
@pytest.mark.parametrize(
    "chosen", [lambda: os.nice(1), lambda: os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))]
)
def test_who_was_put_behind_on_purpose_stays_there(chosen: Callable[[], object]) -> None:
    def ask() -> tuple[bool, bool]:
        chosen()
        before = os.sched_getscheduler(0)
        return run_in_real_time(), os.sched_getscheduler(0) == before

    assert in_thread(ask) == (False, True)
