"""Threads of Zenoh that stay known to Python."""

from __future__ import annotations

import ctypes
import threading

_thread = threading.local()


def stay_attached() -> None:
    """Keep this thread's Python state for as long as the process lives.

    A thread that Python did not start gets a state of its own for each call into Python, and loses it at its end: a
    stack mapped and unmapped for each sample, which costs more than all else that is done with it here. Holding the
    state once more than it is released leaves one of them to each of Zenoh's few threads. The interpreter's lock is not
    held by it.
    """
    if not hasattr(_thread, "attached"):
        _thread.attached = True  # lost with the state, were it not kept
        ctypes.pythonapi.PyGILState_Ensure()
