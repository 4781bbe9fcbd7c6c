"""The live view of a whole cell: what is recorded is what was, whenever a viewer comes, and whatever becomes of it."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit

import httpx

from rackhand.bus import Bus, Presence, Sample
from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.service import CELL, ServiceId
from rackhand.schemas.world import Objects
from rackhand.services.viewer.blueprint import shown
from rackhand.services.viewer.picture import RobotSet
from rackhand.testing import Cell, Judge
from tests.system.cell import ROOT
from tests.system.driving import Driver, standard
from tests.viewer import native, reading
from tests.viewer.native import PATIENCE

CAST = RobotSet(chassis=("amr1",), arms=("arm1",))
INSTANTS = 25  # at which a recording is held to what was, at least: how many more there are depends on the load
SINGLE = 4e-6  # m; recordings hold single precision, and floor 2 is 60 m away
MEMORY = 3_000_000  # bytes that the live view keeps where it is to forget
T = TypeVar("T")


@contextmanager
def recorder(cell: Cell, judge_bus: Bus, file: Path) -> Iterator[None]:
    """``rackhand record``, from when it is on the bus until it has written everything."""
    inbox = judge_bus.inbox().watch_services()
    command = [
        sys.executable,
        "-m",
        "rackhand.services.launch",
        "record",
        str(file),
        "--state-dir",
        str(cell.state_dir),
    ]
    process = subprocess.Popen(command, cwd=ROOT)
    try:
        there = Presence(ServiceId("recorder", CELL), alive=True)
        while (event := inbox.get(timeout=PATIENCE)) != there:
            assert event is not None, "no recorder came"
        yield
        process.send_signal(signal.SIGTERM)
        assert process.wait(PATIENCE) == 0
    finally:
        process.kill()
        process.wait()


def command_arm(driver: Driver, **request: Any) -> None:
    answer = driver.request("POST", "/motion/arm1/command", {"priority": 10, **request})
    assert answer["message"] is True or answer["message"]["code"] == 200, answer


def wait_until_joined(driver: Driver) -> None:
    driver.wait(lambda world: len(world.command_stamps) == 2, "both have joined and answered")


def work(driver: Driver) -> int:
    """A move for the chassis, a path for the arm. Returns the id of the move."""
    move = driver.post(standard(7.0, 1.6, 0.0))
    status = driver.request("GET", "/motion/arm1/status")
    start = status["jointPositions"]["value"]
    command_arm(driver, command="lockControl", keepAlive=60.0)
    command_arm(driver, command="appendPath", type="joints", data=12 * [[q + 0.4 for q in start], start])
    return move


def missing_from(found: set[str]) -> list[str]:
    """What the layout looks at and is not there. Under some of its entities there is one a thing; a rack that is being
    detected is there in rack jobs only."""
    always = (entity for entity in shown(CAST) if "/rack/" not in entity)
    return [entity for entity in always if not any(f"{name}/".startswith(f"{entity}/") for name in found)]


def scene_missing_from(found: set[str]) -> list[str]:
    """The same without the logs: they are history, which ends where memory does."""
    return [entity for entity in missing_from(found) if not entity.endswith("/log")]


def test_the_recording_of_a_lockstep_run_is_what_was(tmp_path: Path) -> None:
    """All that the layout looks at is there, and every pose in it is the simulator's of that instant."""
    file = tmp_path / "run.rrd"
    with Cell(tmp_path) as cell, Judge(cell.bus) as judge:
        judge.pause()
        driver = Driver(cell, judge)
        with Bus(ServiceId("witness", CELL), cell.bus_config()) as bus:
            truth = bus.inbox().subscribe(topics.OBJECTS, depth=100_000)
            with recorder(cell, bus, file):
                wait_until_joined(driver)
                judge.advance(0.1)
                work(driver)
                told: list[Objects] = []
                for _ in range(INSTANTS):
                    told += heard_until(truth, judge.advance(0.4).clock.stamp)
                    wait_until_recorded(cell, file, told[-1].stamp)
        driver.close()

    assert not missing_from(reading.entities(file))
    recorded = reading.poses(file)
    checked = 0
    for objects in told:
        for thing in objects.objects:
            pose = recorded.get((objects.stamp, thing.name))
            if pose is not None:
                assert reading.apart(pose, (thing.position, thing.orientation)) <= SINGLE, (objects.stamp, thing.name)
                checked += 1
    names = {thing.name for thing in told[-1].objects}
    moved = {name for name in names if len({recorded[key] for key in recorded if key[1] == name}) > 10}
    assert {"amr1", "amr1/wheel_left", "amr1/jack", "arm1/wrist_3_link", "anna"} <= moved
    assert checked >= INSTANTS * len(names), f"{checked} poses compared"


def wait_until_recorded(cell: Cell, file: Path, stamp: int) -> None:
    """In a world that stands: what comes meanwhile may never be drawn."""
    cell.wait_for(lambda: (stamp, "amr1") in (so_far(reading.poses, file) or ()) or None, f"{stamp} is there", PATIENCE)


def heard_until(truth: Any, stamp: int) -> list[Objects]:
    found: list[Objects] = []
    period = round(NANOSECONDS / topics.OBJECTS.rate)
    while not found or found[-1].stamp <= stamp - period:
        event = truth.get(timeout=PATIENCE)
        assert isinstance(event, Sample)
        found.append(event.message)
    return found


def test_a_late_viewer_sees_the_whole_scene(tmp_path: Path) -> None:
    """Also when the server has forgotten all that an early reader saw."""
    native.need_lavapipe()
    forgetful = {"RACKHAND_VIEWER_MEMORY": f"{MEMORY}B"}
    with Cell(tmp_path, lockstep=False, viewer=True, environment=forgetful) as cell, Judge(cell.bus) as judge:
        driver = Driver(cell, judge)
        wait_until_joined(driver)
        work(driver)
        wait_until_served(cell)
        early = late = told(cell, judge, tmp_path / "early.rrd")
        while early & late:
            clock = judge.inspect().clock
            native.fill(cell.viewer_stream, clock.run, clock.stamp, MEMORY)
            late = told(cell, judge, tmp_path / "late.rrd")
        driver.close()
        with native.viewer(cell.viewer_stream) as viewer:
            native.until(lambda: not scene_missing_from(native.entities(viewer)) or None, "everything is there")
            native.until(lambda: native.colours(viewer.take_screenshot()) > 500 or None, "it is drawn")
            native.until(lambda: not native.reports(viewer) or None, "nothing is amiss")


def told(cell: Cell, judge: Judge, file: Path) -> set[str]:
    """All that has a time of what somebody is told who reads the stream until the whole scene is there.

    The past comes in no order, but before the present: not until that has come is all of it told.
    """

    def whole(file: Path) -> set[str] | None:
        up_to_date = (reading.end(file) or 0) > present
        return reading.passing(file) if up_to_date and not scene_missing_from(reading.entities(file)) else None

    with native.recording(cell.viewer_stream, file):
        cell.wait_for(lambda: so_far(reading.end, file), "a reader is told something", PATIENCE)
        present = judge.inspect().clock.stamp
        return cell.wait_for(lambda: so_far(whole, file), "a reader has the whole scene", PATIENCE)


def test_a_killed_viewer_disturbs_nothing_and_comes_back(tmp_path: Path) -> None:
    with Cell(tmp_path, lockstep=False, viewer=True) as cell, Judge(cell.bus) as judge:
        driver = Driver(cell, judge)
        wait_until_joined(driver)
        others = {name: cell.pid(name) for name in ("router", "sim", "planner", "controller", "gateway")}
        start = judge.true_pose("amr1")
        move = work(driver)
        driver.wait_until_moving(start.x, start.y)
        former = cell.kill("viewer")
        cell.wait_until_restarted("viewer", former)
        wait_until_served(cell)
        told(cell, judge, tmp_path / "late.rrd")
        assert driver.finish(move)["state"] == "succeeded"
        assert {name: cell.pid(name) for name in others} == others
        assert judge.inspect().contact_count == 0
        driver.close()


def test_what_is_served_is_for_this_machine_only(tmp_path: Path) -> None:
    with Cell(tmp_path, lockstep=False, viewer=True) as cell:
        wait_until_served(cell)
        ports = {int(urlsplit(url).port or 0) for url in (cell.viewer, cell.viewer_stream)}
        for port in ports:
            assert listeners(port) == {"0100007F"}, "listens on more than 127.0.0.1"


def listeners(port: int) -> set[str]:
    """The addresses somebody listens on with this port, as Linux writes them."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    rows += [line.split() for line in Path("/proc/net/tcp6").read_text().splitlines()[1:]]
    return {row[1].split(":")[0] for row in rows if row[3] == "0A" and int(row[1].split(":")[1], 16) == port}


def wait_until_served(cell: Cell) -> None:
    cell.wait_for(lambda: is_served(cell.viewer) or None, "the page is there", PATIENCE)


def is_served(url: str) -> bool:
    try:
        return bool(httpx.get(url, trust_env=False, follow_redirects=True).is_success)
    except httpx.HTTPError:
        return False


def so_far(read: Callable[[Path], T], file: Path) -> T | None:
    """What is read in a file that a recorder still writes; nothing while it is in the middle of a message."""
    try:
        return read(file)
    except (OSError, ValueError, RuntimeError):
        return None
