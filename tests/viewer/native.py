"""Rerun's native viewer without a window, drawn by the processor: needs Mesa's lavapipe."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import TypeVar

import numpy as np
import pytest
import rerun as rr
import rerun_cli
from PIL import Image
from rerun.experimental import ViewerClient, ViewReport

from rackhand.services.viewer.items import Drawing
from rackhand.services.viewer.recording import Recording
from rackhand.testing.ports import free_port

DRIVER = Path("/usr/share/vulkan/icd.d/lvp_icd.x86_64.json")
RERUN = str(Path(rerun_cli.__file__).with_name("rerun"))
SILENT = {"CI": "true", "RUST_LOG": "error"}
PATIENCE = 240.0  # the live view has what all others leave; this only ever bounds a failure
FILLER = 10_000  # bytes of one message
T = TypeVar("T")


def need_lavapipe() -> None:
    """Skips a test where there is none to draw with; in CI that is an error."""
    if not DRIVER.exists() and not os.environ.get("CI"):
        pytest.skip(f"needs {DRIVER}: apt install mesa-vulkan-drivers")


def entities(client: ViewerClient) -> set[str]:
    """What the viewer has of the recording that it shows; nothing before it shows one."""
    if client.get_state().active_recording is None:
        return set()
    schema = client.get_recording_schema(paths_only=True)
    return {entity.entity_path.removeprefix("/") for entity in schema.entities}


def reports(client: ViewerClient) -> list[ViewReport]:
    """What its views cannot show, or doubt."""
    return [report for view in client.get_state().views for report in view.reports]


def colours(png: bytes) -> int:
    """How many there are in a picture."""
    with Image.open(BytesIO(png)) as image:
        return len(image.convert("RGB").getcolors(1 << 24) or ())


def fill(stream: str, run: str, stamp: int, size: int) -> None:
    """Log so many bytes that nobody looks at into a run: a server of that memory forgets all that was before."""
    recording = Recording(run, [rr.GrpcSink(stream)])
    for _ in range(size // FILLER):
        noise = np.frombuffer(os.urandom(FILLER), np.uint8)  # not compressible
        recording.write([(stamp, Drawing("filler", (rr.AnyValues(noise=noise),)))])
    recording.close()


@contextmanager
def recording(stream: str, file: Path) -> Iterator[None]:
    """Rerun's own headless recorder on a stream: a viewer that needs nothing to draw with."""
    file.unlink(missing_ok=True)
    command = [RERUN, stream, "--save", str(file)]
    process = subprocess.Popen(command, env={**os.environ, **SILENT}, stdout=subprocess.DEVNULL)
    try:
        yield
    finally:
        process.terminate()
        process.wait()


@contextmanager
def viewer(stream: str) -> Iterator[ViewerClient]:
    """A viewer that has opened this stream, or file."""
    environment = {"VK_ICD_FILENAMES": str(DRIVER), **SILENT}
    before = {name: os.environ.get(name) for name in environment}
    os.environ.update(environment)
    try:
        client = ViewerClient.spawn(headless=True, port=free_port(), executable_path=RERUN)
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
    try:
        client.open(stream)
        yield client
    finally:
        client.quit()


def until(found: Callable[[], T | None], what: str) -> T:
    """Poll until there is something. Fails when it never is."""
    deadline = time.monotonic() + PATIENCE
    while (value := found()) is None:
        assert time.monotonic() < deadline, f"waited in vain until {what}"
        time.sleep(0.2)
    return value
