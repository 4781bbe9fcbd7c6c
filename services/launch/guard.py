"""Runs a command so that it dies with its parent: ``python guard.py PARENT_PID COMMAND…``.

A supervisor that is killed outright can end nobody, so each child asks the kernel (Linux) to be killed when its parent
is gone. The wish survives ``exec``. Done by a small program of its own rather than between fork and exec, where a
process with threads may run no Python. Where the kernel has no such call, the command just runs.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys

PR_SET_PDEATHSIG = 1


def main() -> None:
    parent, command = int(sys.argv[1]), sys.argv[2:]
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it died before the request took effect
            raise SystemExit(1)
    try:
        os.execvp(command[0], command)
    except OSError as error:
        print(f"cannot run {command[0]}: {error.strerror}", file=sys.stderr)
        raise SystemExit(127) from None


if __name__ == "__main__":
    main()
