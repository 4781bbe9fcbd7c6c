"""The cell as a user starts it: up, told, healed, stopped."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from rackhand.runtime.priority import SLICE_NS
from rackhand.testing import Cell
from tests.launch.conftest import alive, gone
from tests.scheduling import IN_REAL_TIME, grants_real_time, heeded, slice_and_nice
from tests.system.cell import ROOT

SERVICES = {
    "router": "cell/router",
    "sim": "world/sim",
    "planner": "amr1/planner",
    "controller": "arm1/controller",
    "gateway": "cell/gateway",
}
MakeCell = Callable[..., Cell]


def rackhand(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "rackhand.services.launch", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)


@pytest.fixture(scope="module")
def cell(real_time_cell: Cell) -> Cell:
    return real_time_cell


def test_every_service_is_up_and_reported(cell: Cell) -> None:
    answer = httpx.get(f"{cell.http}/healthz")
    assert answer.status_code == 200
    told = {f"{row['robot']}/{row['service']}" for row in answer.json()["services"]}
    assert set(SERVICES.values()) <= told


def test_says_where_things_are(cell: Cell) -> None:
    log = cell.wait_for(lambda: text if "state " in (text := cell.log.read_text()) else None, "places are told")
    for place in (f"{cell.http}/docs", f"{cell.http}/healthz", cell.bus):
        assert place in log
    assert httpx.get(f"{cell.http}/docs").status_code == 200


def test_each_service_is_a_process_of_its_own(cell: Cell) -> None:
    pids = {cell.pid(service) for service in SERVICES}
    assert len(pids) == len(SERVICES)
    assert all(os.getpgid(pid) == pid for pid in pids), "each leads its own process group"


def test_a_longer_period_means_a_lower_priority(cell: Cell) -> None:
    """Niceness counts among the processes of a session: all of a cell are in one."""
    base = os.getpriority(os.PRIO_PROCESS, cell.supervisor.pid)
    nice = {service: os.getpriority(os.PRIO_PROCESS, cell.pid(service)) - base for service in SERVICES}
    assert nice["router"] == nice["sim"] == nice["controller"] == 0 < nice["planner"] < nice["gateway"], nice
    assert {os.getsid(cell.pid(service)) for service in SERVICES} == {os.getsid(cell.supervisor.pid)}


@heeded
@pytest.mark.parametrize("service", ["sim", "controller"])
def test_control_loops_have_short_time_slices_and_so_have_the_threads_of_their_bus(cell: Cell, service: str) -> None:
    threads = {
        int(task.name): (task / "comm").read_text() for task in Path(f"/proc/{cell.pid(service)}/task").iterdir()
    }
    of_the_bus = [thread for thread, name in threads.items() if name.startswith(("rx-", "tx-"))]
    assert of_the_bus, f"no thread of Zenoh among {sorted(threads.values())}"
    base = os.getpriority(os.PRIO_PROCESS, cell.supervisor.pid)
    in_real_time = os.sched_getscheduler(cell.pid(service)) == IN_REAL_TIME
    for thread in of_the_bus if in_real_time else [cell.pid(service), *of_the_bus]:
        assert slice_and_nice(thread) == (SLICE_NS, base)


@grants_real_time
def test_of_all_threads_the_control_loop_alone_is_in_real_time(cell: Cell) -> None:
    """The simulator computes as long as it is let at ``--speed max``: it would leave nothing to others."""
    pids = [cell.pid(service) for service in SERVICES]
    threads = [int(task.name) for pid in pids for task in Path(f"/proc/{pid}/task").iterdir()]
    in_real_time = [thread for thread in threads if os.sched_getscheduler(thread) != os.SCHED_OTHER]
    assert in_real_time == [cell.pid("controller")]
    assert os.sched_getscheduler(cell.pid("controller")) == IN_REAL_TIME


def test_status_tells_the_same(cell: Cell) -> None:
    result = rackhand("status", "--state-dir", str(cell.state_dir))
    assert result.returncode == 0, result.stdout + result.stderr
    assert all(service in result.stdout for service in SERVICES)


def test_a_second_cell_on_the_same_state_is_refused(cell: Cell) -> None:
    result = rackhand("up", "--port", "0", "--bus-port", "0", "--state-dir", str(cell.state_dir))
    assert result.returncode == 1
    assert "another cell runs on the state folder" in result.stderr


@pytest.mark.parametrize("service", ["planner", "controller", "sim", "gateway", "router"])
def test_a_killed_service_comes_back(cell: Cell, service: str) -> None:
    former = cell.kill(service)
    cell.wait_until_restarted(service, former)
    cell.wait_until_up()
    assert f"{service} ended with SIGKILL" in cell.log.read_text()


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_ends_cleanly_on_a_signal(make_cell: MakeCell, number: signal.Signals) -> None:
    cell = make_cell(lockstep=False)
    pids = [cell.pid(service) for service in SERVICES]
    cell.supervisor.send_signal(number)
    assert cell.supervisor.wait(30) == 0
    log = cell.log.read_text()
    assert "killed:" not in log, "every service ended by itself"
    assert log.rstrip().endswith("stopped")
    assert not any(alive(pid) for pid in pids)
    assert not (cell.state_dir / "cell.json").exists()


def test_nothing_outlives_a_killed_supervisor(make_cell: MakeCell) -> None:
    cell = make_cell(lockstep=False)
    pids = [cell.pid(service) for service in SERVICES]
    cell.supervisor.kill()
    cell.supervisor.wait()
    assert all(gone(pid) for pid in pids)


def test_starts_again_on_what_a_killed_cell_left(tmp_path: Path) -> None:
    with Cell(tmp_path, lockstep=False) as first:
        first.supervisor.kill()
        first.supervisor.wait()
    with Cell(tmp_path, lockstep=False) as second:
        assert second.health() is not None
