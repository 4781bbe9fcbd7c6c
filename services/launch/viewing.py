"""Looking at a cell: where its live view is, and the commands that open one or record."""

from __future__ import annotations

import importlib.util
import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import NoReturn

from rackhand.services.launch.ports import in_the_way, with_port
from rackhand.services.launch.processes import CellOptions

# Rerun phones home, but for machines of continuous integration.
SILENT = {"CI": "true"}


class CannotView(Exception):
    """There is nothing to look at, or nothing to look with; the text is for the user."""


def with_viewer(options: CellOptions) -> tuple[CellOptions, str]:
    """The ports of the live view, any for its data. Where the page's is taken: no live view, and the reason."""
    if options.viewer is None:
        return options, ""
    page, data = with_port(options.viewer), options.viewer_data
    if error := in_the_way(page):
        why = f"the live view cannot listen on {page}: {error}. Choose another port with --viewer-port."
        return replace(options, viewer=None), why
    if options.viewer.port == 0 or in_the_way(data):
        data = with_port(replace(data, port=0))
    return replace(options, viewer=page, viewer_data=data), ""


def record_cell(file: Path, bus: str | None) -> NoReturn:
    """Become the recorder of the cell on this bus (where the environment says, if None). Raises ``CannotView``."""
    _check_rerun()
    if not file.parent.is_dir():
        raise CannotView(f"there is no folder {file.parent}")
    environment = {"RACKHAND_BUS_CONNECT": bus} if bus is not None else {}
    _become([sys.executable, "-m", "rackhand.services.viewer", "--no-serve", "--save", str(file)], environment)


def open_viewer(file: Path | None, stream: str | None) -> NoReturn:
    """Become Rerun's native viewer of a file, else of a cell's stream. Raises ``CannotView``."""
    _check_rerun()
    if file is not None and not file.is_file():
        raise CannotView(f"there is no file {file}")
    shown = ["--new", str(file)] if file is not None else ["--connect", stream or CellOptions().viewer_stream]
    _become([sys.executable, "-m", "rerun_cli", *shown], SILENT)


def _check_rerun() -> None:
    if importlib.util.find_spec("rerun") is None:
        raise CannotView("this needs Rerun: pip install 'rackhand[viewer]'")


def _become(command: list[str], environment: dict[str, str]) -> NoReturn:
    os.execve(command[0], command, {**os.environ, **environment})
