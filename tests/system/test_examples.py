"""The examples as their heads say to run them, one after the other on one cell in lockstep."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rackhand.testing import Cell, distance
from rackhand.testing.world import WorldControl
from tests.system.cell import ROOT

EXAMPLES = ROOT / "examples"
# That one has a cell without a simulator to itself: tests/system/test_hardware_driver.py.
ELSEWHERE = {"09_hardware_driver.py"}


def run(name: str, *arguments: str, built: Path | None = None) -> str:
    """What an example prints. Fails with it unless the exit status is 0. ``built``: what was made of it to be run."""
    file = built or EXAMPLES / name
    started_by = {".py": [sys.executable], ".sh": ["bash"], ".ts": ["node"], ".mjs": ["node"]}.get(file.suffix, [])
    result = done(*started_by, str(file), *arguments)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def done(*command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=EXAMPLES, capture_output=True, text=True, timeout=300, check=False)


def runnable_typescript(folder: Path) -> Path:
    """Node runs TypeScript as it is from 22.18 on, an older one what esbuild makes of it."""
    source = EXAMPLES / "03_standard_move.ts"
    if shutil.which("node") is None:
        pytest.skip("Node is not installed")
    major, minor = map(int, done("node", "--version").stdout.strip().lstrip("v").split(".")[:2])
    if (major, minor) >= (22, 18):
        return source
    script = folder / "03_standard_move.mjs"
    if shutil.which("npx") is None or done("npx", "--yes", "esbuild", str(source), f"--outfile={script}").returncode:
        pytest.skip(f"Node {major}.{minor} does not run TypeScript, and npx cannot get esbuild")
    return script


def compiled_c(folder: Path) -> Path:
    """The program of the C example, made as its head says."""
    if shutil.which("cc") is None or shutil.which("pkg-config") is None:
        pytest.skip("a C compiler or pkg-config is not installed")
    libraries = done("pkg-config", "--cflags", "--libs", "zenohpico", "msgpack")
    if libraries.returncode:
        pytest.skip(f"zenoh-pico or msgpack-c is not installed: {libraries.stderr.splitlines()[0]}")
    program = folder / "subscriber"
    flags = ("-Wall", "-Wextra", "-Werror", "-DZENOH_LINUX", "-o", str(program))
    result = done("cc", str(EXAMPLES / "07_subscriber.c"), *libraries.stdout.split(), *flags)
    assert result.returncode == 0, result.stderr
    return program


def test_every_example_is_run_by_a_test() -> None:
    tested = set(re.findall(r'run\(\s*"(\d\d_[^"]+)"', (ROOT / "tests/system/test_examples.py").read_text()))
    assert {path.name for path in EXAMPLES.glob("[0-9]*")} == tested | ELSEWHERE


def test_standard_move_in_python(cell: Cell) -> None:
    assert "succeeded" in run("01_standard_move.py", cell.http, "3.5", "1.5")
    assert distance(cell.true_pose("amr1"), 3.5, 1.5) < 0.06


def test_standard_move_in_the_shell(cell: Cell) -> None:
    run("02_standard_move.sh", cell.http, "3.5", "1.5")
    assert distance(cell.true_pose("amr1"), 3.5, 1.5) < 0.06


def test_standard_move_in_typescript(cell: Cell, tmp_path: Path) -> None:
    script = runnable_typescript(tmp_path)
    assert "succeeded" in run("03_standard_move.ts", cell.http, "3.5", "1.5", built=script)
    assert distance(cell.true_pose("amr1"), 3.5, 1.5) < 0.06


def test_rack_job(cell: Cell, world: WorldControl) -> None:
    printed = run("04_rack_job.py", cell.http)
    assert printed.splitlines()[-1] == "standard: succeeded"
    assert distance(world.true_pose("rack_s8"), 5.8, 9.4) < 0.03
    assert world.contacts() == ()


def test_follower(cell: Cell, world: WorldControl) -> None:
    world.move("amr1", (3.5, 7.4, 0.0))
    apart = re.findall(r"([0-9.]+) m from it", run("05_follower.py", cell.http, "5.0", "6.5"))
    assert 1.0 < float(apart[-1]) < 1.4
    assert world.contacts() == ()


def test_arm_pick(cell: Cell) -> None:
    printed = run("06_arm_pick.py", cell.http)
    assert printed.splitlines() == ["holding", "released", "given back: True"]
    x, y, z = cell.objects()["parcel_red"].position
    assert (x, y, z) == pytest.approx((18.05, 11.6, 0.75), abs=0.02), "it stands on the table where it was set down"


def test_subscriber(cell: Cell) -> None:
    are_poses_of_the_start(run("07_subscriber.py", cell.bus))


def test_subscriber_in_c(cell: Cell, tmp_path: Path) -> None:
    program = compiled_c(tmp_path)
    are_poses_of_the_start(run("07_subscriber.c", cell.bus, built=program))


def are_poses_of_the_start(printed: str) -> None:
    poses = re.findall(r"x (\S+) m  y (\S+) m", printed)
    assert len(poses) == 5
    assert all((float(x), float(y)) == pytest.approx((2.5, 1.5), abs=0.05) for x, y in poses)


def test_new_topic(cell: Cell) -> None:
    reports = re.findall(r"(\S+) s  (\S+) m", run("08_new_topic.py", cell.bus))
    assert len(reports) == 4
    stamps = [float(stamp) for stamp, _ in reports]
    assert stamps == sorted(set(stamps)) and float(reports[-1][1]) < 0.05, "the robot rests"


def test_judge(cell: Cell) -> None:
    printed = run("10_judge.py", cell.bus)
    x, y, off = map(float, re.findall(r"-?[0-9]+\.[0-9]+", printed))
    assert (x, y) == pytest.approx((2.5, 1.5), abs=0.01)
    assert off < 50 and "contacts: []" in printed


def test_fault_scenario() -> None:
    failed, succeeded = run("11_fault_scenario.py").splitlines()
    assert failed.startswith("failed: no usable scan") and succeeded.startswith("succeeded")


def test_plot_of_a_recording(cell: Cell, tmp_path: Path) -> None:
    recording, picture = tmp_path / "run.rrd", tmp_path / "run.svg"
    command = [sys.executable, "-m", "rackhand.services.launch", "record", str(recording), "--bus", cell.bus]
    with subprocess.Popen(command) as recorder:
        try:
            cell.wait_until_there("cell/recorder", timeout=240.0)
            run("01_standard_move.py", cell.http, "3.5", "1.5")
        finally:
            recorder.terminate()
    printed = run("12_plot.py", str(recording), str(picture))
    poses = int(printed.split()[0])
    assert poses > 0 and picture.read_text().count("<polyline") == 2
