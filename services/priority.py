"""Who goes first where a machine has too few processors for all services."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path


def stand_back(nice: int) -> None:
    """Leave the processor to others: this process, and those it starts from now on, run with ``nice`` (1 to 19).

    Linux may share the processor among sessions first (autogroup, see sched(7)). Niceness then only orders the
    processes of one session; the session has one of its own, and the supervisor starts each service in its own.
    """
    os.nice(nice)
    if os.getsid(0) == os.getpid():  # what else runs in a user's terminal is not ours to slow down
        with suppress(OSError):  # a kernel without autogroups
            Path("/proc/self/autogroup").write_text(str(nice))
