"""How Linux schedules a thread, as it tells it."""

from __future__ import annotations

import ctypes
import os
import platform
import struct
import threading
from collections.abc import Callable

import pytest

_GETATTR = {"x86_64": 315, "aarch64": 275}  # number of the system call sched_getattr
IN_REAL_TIME = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK if platform.system() == "Linux" else -1

on_linux = pytest.mark.skipif(platform.system() != "Linux", reason="policies are Linux's")
heeded = pytest.mark.skipif(
    platform.system() != "Linux"
    or platform.machine() not in _GETATTR
    or tuple(map(int, platform.release().split(".")[:2])) < (6, 12),
    reason="short slices can be had from Linux 6.12 on",
)


def in_thread(ask: Callable[[], object]) -> object:
    """What ``ask`` returns in a thread of its own, since what it changes is the thread's."""
    answers: list[object] = []
    thread = threading.Thread(target=lambda: answers.append(ask()))
    thread.start()
    thread.join()
    return answers[0]


def slice_and_nice(thread: int = 0) -> tuple[int, int]:
    """In ns, and the nice value. ``thread``: 0 is the caller's."""
    attributes = ctypes.create_string_buffer(48)
    assert ctypes.CDLL(None).syscall(_GETATTR[platform.machine()], thread, attributes, 48, 0) == 0
    _, _, _, nice, _, slice_ns, _, _ = struct.unpack("=IIQiIQQQ", attributes.raw)
    return slice_ns, nice


def real_time_is_granted() -> bool:
    """To this process, and so to those it starts. Asked without the code under test."""

    def ask() -> bool:
        try:
            os.sched_setscheduler(0, IN_REAL_TIME, os.sched_param(1))
        except PermissionError:
            return False
        return True

    return platform.system() == "Linux" and os.getpriority(os.PRIO_PROCESS, 0) <= 0 and bool(in_thread(ask))


grants_real_time = pytest.mark.skipif(not real_time_is_granted(), reason="no right to real time here (ulimit -r)")
