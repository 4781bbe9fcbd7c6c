"""Rerun's own server, as a child process: recordings over gRPC, and the parts of the web viewer that shows them."""

from __future__ import annotations

import ctypes
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType

import rerun_cli

from rackhand.services.viewer.page import Page, stream_url

PR_SET_PDEATHSIG = 1
EVERYWHERE = ("0.0.0.0", "::")
PATIENCE = 20.0
# Rerun phones home, but for machines of continuous integration.
SILENT = {"CI": "true", "RUST_LOG": "error", "NO_COLOR": "1"}


class CannotServe(Exception):
    """The server does not come up; the text is for the user."""


class Server:
    """Use as a context manager, before any thread is started. It ends with this process, however that ends."""

    def __init__(self, host: str, web_port: int, data_port: int, memory: str) -> None:
        self.host, self.web_port, self.data_port = host, web_port, data_port
        self._memory = memory
        self._assets = (self.near, _free_port(host))

    @property
    def near(self) -> str:
        """The address at which this machine reaches it."""
        return "127.0.0.1" if self.host in EVERYWHERE else self.host

    @property
    def data_url(self) -> str:
        """For recordings, and for native viewers on this machine."""
        return stream_url(self.near, self.data_port)

    @property
    def page_url(self) -> str:
        return f"http://{self.near}:{self.web_port}/"

    def page(self) -> Page:
        """The page for browsers; it has threads. Raises ``CannotServe`` where its port is taken."""
        try:
            return Page(self.host, self.web_port, self._assets, self.data_port)
        except OSError as error:
            raise CannotServe(f"the page cannot listen on {self.host}:{self.web_port}: {error.strerror}") from None

    @property
    def ended(self) -> bool:
        return self._child.poll() is not None

    def __enter__(self) -> Server:
        command = [str(Path(rerun_cli.__file__).with_name("rerun")), "--serve-web", "--bind", self.host]
        command += ["--port", str(self.data_port), "--web-viewer-port", str(self._assets[1])]
        command += ["--server-memory-limit", self._memory, "--newest-first"]  # who comes late sees the present at once
        command += ["--cors-allow-origin", f"http://*:{self.web_port}"]  # of its own page, whatever this machine's name
        self._child = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            env={**os.environ, **SILENT},
            process_group=0,  # a signal to this process' group is not for the server: it ends last
            preexec_fn=_die_with_parent,
        )
        self._wait()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._child.terminate()
        try:
            self._child.wait(2.0)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()

    def _wait(self) -> None:
        """Until both ports are open."""
        deadline = time.monotonic() + PATIENCE
        while not all(_accepts(*address) for address in ((self.near, self.data_port), self._assets)):
            if self.ended or time.monotonic() > deadline:
                self.__exit__(None, None, None)
                raise CannotServe(f"Rerun's server did not start on {self.host}:{self.data_port}: is the port taken?")
            time.sleep(0.05)


def _accepts(host: str, port: int) -> bool:
    try:
        socket.create_connection((host, port), timeout=1.0).close()
    except OSError:
        return False
    return True


def _free_port(host: str) -> int:
    with socket.socket() as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])


def _die_with_parent() -> None:
    """In the child, before the server runs: the kernel (Linux) ends it with this process."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
