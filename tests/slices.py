"""How long a thread may keep the processor, as Linux tells it."""

from __future__ import annotations

import ctypes
import platform
import struct

import pytest

_GETATTR = {"x86_64": 315, "aarch64": 275}  # number of the system call sched_getattr

heeded = pytest.mark.skipif(
    platform.system() != "Linux"
    or platform.machine() not in _GETATTR
    or tuple(map(int, platform.release().split(".")[:2])) < (6, 12),
    reason="short slices can be had from Linux 6.12 on",
)


def slice_and_nice(thread: int = 0) -> tuple[int, int]:
    """In ns, and the nice value. ``thread``: 0 is the caller's."""
    attributes = ctypes.create_string_buffer(48)
    assert ctypes.CDLL(None).syscall(_GETATTR[platform.machine()], thread, attributes, 48, 0) == 0
    _, _, _, nice, _, slice_ns, _, _ = struct.unpack("=IIQiIQQQ", attributes.raw)
    return slice_ns, nice
