"""Zenoh's threads keep their Python state from one sample to the next."""

from __future__ import annotations

import queue
import threading

import pytest

from rackhand.bus import Bus, BusConfig, Inbox
from rackhand.bus.inbox import _Source
from rackhand.schemas import topics
from rackhand.schemas.base import Twist2
from rackhand.schemas.chassis import ChassisCommand
from rackhand.schemas.service import WORLD, ServiceId

SAMPLES = 20


def test_a_thread_of_zenoh_remembers_the_sample_before(router: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """What Python holds for a thread is gone with the thread's state; a thread without one counts to 1 for ever."""
    counted: queue.Queue[tuple[int, int]] = queue.Queue()
    local = threading.local()

    class Counting(_Source):
        def push(self, item: object) -> bool:
            local.count = getattr(local, "count", 0) + 1
            counted.put((threading.get_native_id(), local.count))
            return super().push(item)

    with (
        Bus(ServiceId("driver", "amr1"), BusConfig(connect=router)) as receiver,
        Bus(ServiceId("planner", WORLD), BusConfig(connect=router)) as sender,
    ):
        inbox: Inbox = receiver.inbox()
        monkeypatch.setattr("rackhand.bus.inbox._Source", Counting)
        inbox.subscribe(topics.COMMAND, "amr1")
        publisher = sender.publisher(topics.COMMAND, "amr1")
        command = ChassisCommand(answers=0, twist=Twist2(linear=0.0, angular=0.0))
        while inbox.get(timeout=0.1) is None:
            publisher.put(command)
        for _ in range(SAMPLES):
            publisher.put(command)
            assert inbox.get(timeout=20) is not None
    counts: dict[int, int] = {}
    while not counted.empty():
        thread, count = counted.get()
        counts[thread] = max(count, counts.get(thread, 0))
    assert sum(counts.values()) > SAMPLES
