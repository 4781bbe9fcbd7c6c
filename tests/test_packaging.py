"""What an installed wheel puts into a user's environment: the one name ``rackhand``, with all data that it reads."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
BUILD = "import sys; from setuptools import build_meta; build_meta.build_wheel(sys.argv[1])"


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A wheel that is built from a copy of what the repository tracks."""
    folder = tmp_path_factory.mktemp("wheel")
    copy = folder / "copy"
    tracked = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in filter(None, tracked.split("\0")):
        if not (ROOT / name).exists():
            continue
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, copy / name, follow_symlinks=False)
    subprocess.run([sys.executable, "-c", BUILD, str(folder)], cwd=copy, capture_output=True, check=True)
    (wheel,) = folder.glob("*.whl")
    return wheel


@pytest.fixture(scope="module")
def names(wheel: Path) -> set[str]:
    return set(zipfile.ZipFile(wheel).namelist())


def test_it_installs_one_name(names: set[str]) -> None:
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {"rackhand"}


def test_every_module_and_every_data_file_is_in_it(names: set[str]) -> None:
    folders = ("schemas", "bus", "runtime", "services", "testing", "scenarios", "worlds")
    kinds = {".py", ".yaml", ".xml", ".png", ".geojson", ".html", ".css", ".js"}
    files = [path for folder in folders for path in (ROOT / folder).rglob("*") if path.suffix in kinds]
    missing = {f"rackhand/{path.relative_to(ROOT)}" for path in files} - names
    assert len(files) > 200
    assert missing == set()


COMPILE = re.findall(r"^RUN python -m (rackhand.+warm_up)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)


def test_some_images_compile() -> None:
    assert len(COMPILE) == 3


@pytest.mark.parametrize("module", COMPILE)
def test_what_an_image_compiles_with_runs(module: str) -> None:
    done = subprocess.run([sys.executable, "-m", module], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_it_says_that_it_is_typed(names: set[str]) -> None:
    assert "rackhand/py.typed" in names


def test_pytest_finds_the_plugin_of_the_test_kit(wheel: Path) -> None:
    archive = zipfile.ZipFile(wheel)
    (entry_points,) = (name for name in archive.namelist() if name.endswith("entry_points.txt"))
    assert "[pytest11]\nrackhand.testing.plugin = rackhand.testing.plugin\n" in archive.read(entry_points).decode()
