"""Zenoh's threads keep their Python thread state."""

from __future__ import annotations

import ctypes
import threading

_thread = threading.local()


def stay_attached() -> None:
    """Keep this thread's Python thread state until the process ends.

    A thread that Python did not start gets a new thread state for each call into Python, which is freed when the call
    returns: a stack mapped and unmapped for each sample, which costs more than all other work here. One
    ``PyGILState_Ensure`` without its release keeps one state for each of Zenoh's few threads. It does not hold the
    interpreter lock.
    """
    if not hasattr(_thread, "attached"):
        _thread.attached = True  # thread-local: it would be lost with the thread state
        ctypes.pythonapi.PyGILState_Ensure()
