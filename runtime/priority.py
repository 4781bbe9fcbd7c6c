"""Priorities of processes and threads, for machines with too few processors for all services."""

from __future__ import annotations

import ctypes
import os
import platform
import struct

# Rate-monotonic order: a longer period means a lower priority (Liu and Layland 1973, "Scheduling Algorithms for
# Multiprogramming in a Hard-Real-Time Environment"). An arm's controller and the simulator have 4 ms and keep
# niceness 0, a chassis' planner has 40 ms, the gateway's clients must not delay what moves, viewers take what is left.
PLANNER, GATEWAY, RECORDER, VIEWER = 5, 10, 10, 19
SLICE_NS = 200_000  # of threads that are to wake soon
REAL_TIME = 1  # the lowest real-time priority: above all normal threads, below all other real-time ones
_SETATTR = {"x86_64": 314, "aarch64": 274}  # number of the system call sched_setattr, which Python has no name for


def set_niceness(nice: int) -> None:
    """Lower the priority of this process, and of those it starts from now on, to niceness ``nice`` (1 to 19).

    Linux may share the processor among sessions first (autogroup, see sched(7)), and then niceness orders the processes
    of a session only. All of a cell are in one: its supervisor's.
    """
    os.nice(nice)


def set_short_slice() -> bool:
    """Ask the scheduler for short time slices for this thread and those it starts from now on, so that they wake soon.

    Linux lets a thread with short slices preempt one that computes for long on the same core, which otherwise may keep
    it for a whole control period of an arm. It is no priority: shares of the processor stay, and no rights are needed.

    Call it before the bus is opened, so that it includes Zenoh's threads. Returns False where it does not apply: on
    another system, or under a policy other than the default. Effective from Linux 6.12 on.
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
    """Give this thread a real-time policy: it preempts every normal thread. Threads that it starts do not inherit it.

    For the thread of a control loop, where the system permits it: to root, with CAP_SYS_NICE, or with an RLIMIT_RTPRIO
    of at least 1 (``ulimit -r``). Returns False where it does not, on a system other than Linux, and where a policy or
    niceness was chosen from outside. If the thread never sleeps, Linux still leaves 5 % to all others.
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
