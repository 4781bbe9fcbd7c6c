"""Progress where there is no terminal: lines, and none of what ends soon."""

from __future__ import annotations

import io
import time

from rackhand.services.launch.progress import Progress


def test_lines_say_how_much_is_done_of_each() -> None:
    stream = io.StringIO()
    with Progress("functions", stream, every=0.02) as progress:
        progress.show("planner", 3, 10)
        progress.show("search", 0, None)
        deadline = time.monotonic() + 30
        while "planner 3 of 10, search functions after 0 s\n" not in stream.getvalue():
            assert time.monotonic() < deadline, stream.getvalue()
            time.sleep(0.01)


def test_what_ends_soon_writes_nothing() -> None:
    stream = io.StringIO()
    with Progress(stream=stream) as progress:
        progress.show("planner", 10, 10)
    assert stream.getvalue() == ""


def test_said_lines_are_written_as_they_are() -> None:
    stream = io.StringIO()
    with Progress(stream=stream) as progress:
        progress.say("world 7: [succeeded] " + "x" * 200)
    assert stream.getvalue() == "world 7: [succeeded] " + "x" * 200 + "\n"
