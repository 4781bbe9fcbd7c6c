"""The supervisor with small children, in processes of their own."""

from __future__ import annotations

import os
import re
import signal
import socket
import sys
from collections.abc import Callable
from itertools import pairwise

import pytest

from tests.launch.conftest import STAY, Running, alive, gone, python

Supervise = Callable[..., Running]


def test_lines_carry_time_and_name(supervise: Supervise) -> None:
    running = supervise({"aa": python(r"print('one\ntwo', end='', flush=True); import signal; signal.pause()")})
    assert re.fullmatch(r"\d\d:\d\d:\d\d aa      one", running.until("one"))
    running.process.terminate()
    assert running.end() == 0
    assert any(line.endswith("aa      two") for line in running.lines), "a line without an end is still said"


def test_a_child_that_crashes_comes_back_later_and_later(supervise: Supervise) -> None:
    policy = {"first_delay": 0.01, "longest_delay": 0.04, "attempts": 5}
    rows = [{"name": "bb", "argv": STAY}, {"name": "aa", "argv": python("raise SystemExit(7)"), "needs": ["bb"]}]
    running = supervise(rows, policy=policy)
    bystander = running.pid_of("bb")
    assert running.end() == 1
    waits = re.findall(r"aa ended with exit code 7; restarting in (\S+) s", "\n".join(running.lines))
    assert waits == ["0.01", "0.02", "0.04", "0.04"]
    assert any("giving up: it ended 5 times" in line for line in running.lines)
    assert not alive(bystander)


def test_the_delay_is_waited_for(supervise: Supervise) -> None:
    policy = {"first_delay": 0.3, "longest_delay": 0.3, "attempts": 3}
    running = supervise(
        {"aa": python("import time; print('at', time.monotonic()); raise SystemExit(7)")}, policy=policy
    )
    assert running.end() == 1
    starts = [float(line.rpartition(" ")[2]) for line in running.lines if "aa      at" in line]
    assert len(starts) == 3
    assert all(later - earlier >= 0.3 for earlier, later in pairwise(starts))


def test_a_killed_child_comes_back_with_a_new_pid(supervise: Supervise) -> None:
    running = supervise({"aa": STAY, "bb": STAY}, policy={"first_delay": 0.01})
    first = running.pid_of("aa")
    os.kill(first, signal.SIGKILL)
    running.until("aa ended with SIGKILL; restarting in 0.01 s")
    assert running.pid_of("aa") != first
    assert running.process.poll() is None


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_stops_all_on_a_signal(supervise: Supervise, number: signal.Signals) -> None:
    running = supervise([{"name": "aa", "argv": STAY}, {"name": "bb", "argv": STAY, "needs": ["aa"]}])
    pids = [running.pid_of("aa"), running.pid_of("bb")]
    running.process.send_signal(number)
    assert running.end() == 0
    assert f"{number.name}: stopping" in "\n".join(running.lines)
    assert not any(alive(pid) for pid in pids)


def test_a_child_that_will_not_end_is_killed(supervise: Supervise) -> None:
    stubborn = python(
        "import os, signal\nsignal.signal(signal.SIGTERM, lambda *_: print('never'))\nprint('pid', os.getpid())\n"
        "while True: signal.pause()"
    )
    running = supervise({"aa": stubborn}, grace=0.2)
    pid = running.pid_of("aa")
    running.process.terminate()
    assert running.end() == 0
    assert "still running after 0.2 s, killed: aa" in "\n".join(running.lines)
    assert not alive(pid)


def test_what_a_killed_child_leaves_behind_ends_too(supervise: Supervise) -> None:
    parent = python(
        f"import os, signal, subprocess\nprint('parent', os.getpid())\nsubprocess.Popen({STAY!r})\nsignal.pause()"
    )
    running = supervise({"aa": parent}, policy={"first_delay": 3600, "longest_delay": 3600})
    grandchild = running.pid_of("aa")
    os.kill(int(running.until("parent").rpartition(" ")[2]), signal.SIGKILL)
    assert gone(grandchild)


def test_children_of_children_end_too(supervise: Supervise) -> None:
    parent = python(
        f"import os, subprocess\nsubprocess.Popen({STAY!r})\nimport signal\nsignal.pause()",
    )
    running = supervise({"aa": parent})
    grandchild = running.pid_of("aa")
    running.process.terminate()
    assert running.end() == 0
    assert gone(grandchild)


@pytest.mark.skipif(sys.platform != "linux", reason="needs PR_SET_PDEATHSIG")
def test_no_child_outlives_a_killed_supervisor(supervise: Supervise) -> None:
    running = supervise({"aa": STAY})
    pid = running.pid_of("aa")
    running.process.kill()
    running.process.wait()
    assert gone(pid)


def test_what_cannot_be_run_ends_the_cell(supervise: Supervise) -> None:
    running = supervise({"aa": ["/no/such/program"], "bb": STAY})
    assert running.end() == 1
    assert "cannot run /no/such/program: No such file or directory" in "\n".join(running.lines)
    assert "giving up" in "\n".join(running.lines)


def test_a_cell_goes_on_without_what_is_optional(supervise: Supervise) -> None:
    running = supervise([{"name": "aa", "argv": ["/no/such/program"], "optional": True}, {"name": "bb", "argv": STAY}])
    pid = running.pid_of("bb")
    running.until("aa ended with exit code 127; continuing without it")
    assert running.process.poll() is None and alive(pid)
    running.process.terminate()
    assert running.end() == 0


def test_a_needed_process_accepts_connections_first(supervise: Supervise) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    # It listens only after it has said so, and it says so only after half a second: "bb" must come later still.
    server = python(
        f"import socket, time\ntime.sleep(0.5)\nprint('listening')\ns = socket.create_server(('127.0.0.1', {port}))\n"
        "while True: s.accept()"
    )
    running = supervise(
        [
            {"name": "bb", "argv": STAY, "needs": ["aa"]},
            {"name": "aa", "argv": server, "listens": ["127.0.0.1", port]},
        ]
    )
    running.pid_of("bb")
    assert any("listening" in line for line in running.lines)


def test_a_reader_that_goes_away_ends_the_cell(supervise: Supervise) -> None:
    running = supervise(
        {"aa": python("import os\nprint('pid', os.getpid())\nimport time\nwhile True: print('x'); time.sleep(0.01)")}
    )
    pid = running.pid_of("aa")
    running.process.stdout.close()  # type: ignore[union-attr]
    assert running.process.wait(30) == 0
    assert gone(pid)
