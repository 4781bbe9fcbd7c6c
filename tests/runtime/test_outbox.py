"""Nothing is said before it is on disk, and nothing waits while nothing is written."""

from __future__ import annotations

from functools import partial

import pytest

from rackhand.runtime.outbox import Outbox
from rackhand.runtime.store import Settled


class Bench:
    def __init__(self) -> None:
        self.submitted = 7
        self.said: list[str] = []
        self.outbox = Outbox(lambda: self.submitted)

    def say(self, text: str) -> None:
        self.outbox.put(partial(self.said.append, text))

    def reply(self, text: str, since: int) -> None:
        self.outbox.put(partial(self.said.append, text), lambda why: self.said.append(f"refused: {why}"), since)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_without_writing_all_is_said_at_once(bench: Bench) -> None:
    bench.say("a")
    bench.reply("b", 7)
    assert bench.said == ["a", "b"]


def test_what_was_caused_by_a_change_waits_for_it_and_so_does_all_that_follows(bench: Bench) -> None:
    bench.submitted = 9
    bench.say("created")
    bench.reply("move 1", 7)
    bench.submitted = 10
    bench.say("ended")
    bench.outbox.settle(Settled(8))
    assert bench.said == []
    bench.outbox.settle(Settled(9))
    assert bench.said == ["created", "move 1"]
    bench.outbox.settle(Settled(10))
    bench.say("later")
    assert bench.said == ["created", "move 1", "ended", "later"]


def test_only_the_request_whose_change_failed_is_refused(bench: Bench) -> None:
    bench.submitted = 8
    bench.reply("first", 7)
    bench.reply("a question in between", 8)
    bench.submitted = 10
    bench.reply("second", 8)
    bench.say("published all the same")
    for number, error in ((8, None), (9, OSError("disk full")), (10, None)):
        bench.outbox.settle(Settled(number, error))
    assert bench.said == ["first", "a question in between", "refused: disk full", "published all the same"]
    bench.reply("third", 10)
    assert bench.said[-1] == "third"


def test_a_job_that_is_written_at_last_says_nothing_again(bench: Bench) -> None:
    bench.submitted = 8
    bench.reply("first", 7)
    bench.outbox.settle(Settled(8, OSError("disk full")))
    bench.outbox.settle(Settled(8))
    assert bench.said == ["refused: disk full"]
