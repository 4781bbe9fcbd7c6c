"""A thread that owns what is on disk: order, failures, and what is tried again."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest

from rackhand.runtime.store import Settled, StoreThread


class Disk:
    """A resource that remembers who touched it, and may be full."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.full = False
        self.threads = {threading.get_ident()}
        self.closed = False

    def write(self, line: str) -> None:
        self.threads.add(threading.get_ident())
        if self.full:
            raise OSError(f"no space left for {line}")
        self.lines.append(line)

    def close(self) -> None:
        self.threads.add(threading.get_ident())
        self.closed = True


Store = StoreThread[Disk]


class Reports:
    """What a store thread reported, for a test that waits for it."""

    def __init__(self) -> None:
        self.all: list[tuple[int, str]] = []
        self._news = threading.Condition()

    def __call__(self, settled: Settled) -> None:
        with self._news:
            self.all.append((settled.number, str(settled.error or "")))
            self._news.notify_all()

    def wait(self, count: int) -> list[tuple[int, str]]:
        with self._news:
            assert self._news.wait_for(lambda: len(self.all) >= count, 20), self.all
            return self.all


@pytest.fixture
def reports() -> Reports:
    return Reports()


@pytest.fixture
def store(reports: Reports) -> Iterator[Store]:
    store = StoreThread("test", Disk, Disk.close, reports, retry=0.01)
    yield store
    store.close()


def line(text: str) -> Callable[[Disk], None]:
    return lambda disk: disk.write(text)


def fill(disk: Disk) -> None:
    disk.full = True


def make_room(disk: Disk) -> None:
    disk.full = False


def test_jobs_are_done_in_order_in_one_thread_that_is_not_the_caller_s(store: Store, reports: Reports) -> None:
    numbers = [store.submit(line(str(i))) for i in range(100)]
    disk = store.call(lambda disk: disk)
    assert disk.lines == [str(i) for i in range(100)]
    assert reports.wait(100) == [(number, "") for number in numbers]
    assert len(disk.threads) == 1 and threading.get_ident() not in disk.threads


def test_an_error_of_opening_and_of_a_call_reaches_the_caller() -> None:
    def broken() -> Disk:
        raise OSError("no such folder")

    with pytest.raises(OSError, match="no such folder"):
        StoreThread("test", broken, Disk.close)
    store = StoreThread("test", Disk, Disk.close)
    store.call(fill)
    with pytest.raises(OSError, match="no space left for x"):
        store.call(line("x"))
    store.close()


def test_after_a_failure_jobs_fail_untried_until_the_owner_knows_of_it(store: Store, reports: Reports) -> None:
    """They were made in the belief that it would work: a map is patched that was never created."""
    store.call(fill)
    store.submit(line("create"))
    store.call(make_room)
    store.submit(line("patch"))
    assert [error for _, error in reports.wait(2)] == ["no space left for create"] * 2
    store.resume()
    store.submit(line("list"))
    assert reports.wait(3)[-1] == (3, "")
    assert store.call(lambda disk: disk.lines) == ["list"]


def test_what_is_to_be_kept_is_written_in_order_when_the_disk_is_well_again(store: Store, reports: Reports) -> None:
    store.call(fill)
    for text in ("a", "b"):
        store.submit(line(text), keep=True)
    store.submit(line("lost"))
    assert [bool(error) for _, error in reports.wait(3)] == [True] * 3
    store.call(make_room)
    assert reports.wait(5)[3:] == [(1, ""), (2, "")], "by itself"
    store.resume()
    store.submit(line("c"))
    reports.wait(6)
    assert store.call(lambda disk: disk.lines) == ["a", "b", "c"]


def test_closing_writes_what_is_left(reports: Reports) -> None:
    store = StoreThread("test", Disk, Disk.close, reports, retry=1000.0)
    disk = store.call(lambda disk: disk)
    store.call(fill)
    store.submit(line("a"), keep=True)
    reports.wait(1)
    store.call(make_room)
    store.close()
    assert (disk.lines, disk.closed) == (["a"], True)
