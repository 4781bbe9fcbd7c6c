"""Who goes first where a machine has too few processors for all services."""

from __future__ import annotations

import ctypes
import os
import platform
import struct

# Whoever has more time goes later (rate-monotonic order: Liu and Layland 1973, "Scheduling Algorithms for
# Multiprogramming in a Hard-Real-Time Environment"): an arm's controller and the simulator have 4 ms and stand back for
# nobody, a chassis' planner has 40, clients must not hold up what moves, and who looks takes what is left.
PLANNER, GATEWAY, RECORDER, VIEWER = 5, 10, 10, 19
SLICE_NS = 200_000  # of those who wake promptly
REAL_TIME = 1  # the lowest real-time priority: in real time all the same, and before nobody else who is
_SETATTR = {"x86_64": 314, "aarch64": 274}  # number of the system call sched_setattr, which Python has no name for


def set_niceness(nice: int) -> None:
    """Leave the processor to others: this process, and those it starts from now on, run with ``nice`` (1 to 19).

    Linux may share the processor among sessions first (autogroup, see sched(7)), and then niceness orders the processes
    of a session only. All of a cell are in one: its supervisor's.
    """
    os.nice(nice)


def set_short_slice() -> bool:
    """Let this thread, and those it starts from now on, run soon after what they wait for has come.

    Who asks Linux for short slices is let in before who computes for long on the same core, which otherwise may go on
    for a whole control period of an arm. This is no priority: shares of the processor stay, and no rights are needed.

    Call it before the bus is opened, for Zenoh's threads to be among them. Returns False where there is nothing to ask:
    on another system, or under a policy that somebody chose on purpose. Linux heeds it from 6.12 on.
    Source: sched_setattr(2), ``sched_runtime`` under SCHED_OTHER.
    """
    number = _SETATTR.get(platform.machine()) if platform.system() == "Linux" else None
    if number is None or os.sched_getscheduler(0) != os.SCHED_OTHER:
        return False
    nice = os.getpriority(os.PRIO_PROCESS, 0)
    # struct sched_attr: size, policy, flags, nice, priority, runtime, deadline, period
    attributes = struct.pack("=IIQiIQQQ", 48, os.SCHED_OTHER, 0, nice, 0, SLICE_NS, 0, 0)
    return bool(ctypes.CDLL(None).syscall(number, 0, attributes, 0) == 0)


def run_in_real_time() -> bool:
    """Let this thread run whenever it has something to do, before all that is not in real time; what it starts is not.

    For the thread that keeps a control loop, where the system grants it: to root, with CAP_SYS_NICE, or with an
    RLIMIT_RTPRIO of at least 1 (``ulimit -r``). Returns False where it does not, on a system other than Linux, and
    where somebody chose a policy or niceness on purpose. Should the thread never rest, Linux leaves 5 % to all others.
    Source: sched(7), SCHED_FIFO and SCHED_RESET_ON_FORK.
    """
    if platform.system() != "Linux" or os.sched_getscheduler(0) != os.SCHED_OTHER:
        return False
    if os.getpriority(os.PRIO_PROCESS, 0) > 0:
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(REAL_TIME))
    except PermissionError:
        return False
    return True
