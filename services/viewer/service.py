"""The viewer as a process: bus in, Rerun out. Frames are made of the newest values, not of every message."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rerun as rr

from rackhand.bus import Bus, Event, Presence, Sample
from rackhand.bus.log import configure_logging, get_logger
from rackhand.schemas import topics
from rackhand.schemas.base import NANOSECONDS
from rackhand.schemas.service import CELL, ServiceId
from rackhand.schemas.topics import Qos
from rackhand.services.viewer import answers
from rackhand.services.viewer.blueprint import blueprint
from rackhand.services.viewer.bus_view import presence
from rackhand.services.viewer.picture import Picture, RobotSet, drawn_topics, newest_topics
from rackhand.services.viewer.recording import Recording, Stamped
from rackhand.services.viewer.server import CannotServe, Server

log = get_logger(__name__)

READ_AHEAD = 1024  # events a frame takes in at most
ROWS_EVERY, REPEAT_EVERY = 1.0, 5.0  # seconds of wall time
REST, LONGEST_REST = 9.0, 1.0  # after a frame: times as long as it took, and seconds of wall time at most
SETTLED = 0.5  # seconds of wall time without another robot
CLOCK_PATIENCE = 1.0  # seconds of wall time after which a cell without a clock is drawn
AHEAD = 5 * NANOSECONDS  # what is stamped later than this after the clock is of a run that is over


@dataclass(frozen=True)
class Settings:
    """Settings of ``python -m rackhand.services.viewer``. ``rate`` in frames a second of wall time."""

    host: str = "127.0.0.1"
    web_port: int = 9090
    data_port: int = 9876
    memory: str = "256MB"
    rate: float = 25.0
    save: Path | None = None
    serve: bool = True


def run(settings: Settings) -> int:
    """Draw until a signal. Returns the exit code: 1 if the server cannot run, or ended by itself."""
    service = "viewer" if settings.serve else "recorder"
    configure_logging(service)
    with ExitStack() as stack:
        server = None
        if settings.serve:
            server = Server(settings.host, settings.web_port, settings.data_port, settings.memory)
            try:
                stack.enter_context(server)  # before there are any threads
                stack.enter_context(server.page())
            except CannotServe as error:
                log.error(str(error))
                return 1
        bus = stack.enter_context(Bus(ServiceId(service, CELL)))
        bus.handle_signals()
        answers.serve(bus)
        viewer = Viewer(bus, _recordings(settings, server), settings.rate, settings.save is not None)
        bus.announce()
        if server is not None:
            log.info("serving", url=server.page_url)
        viewer.run(lambda: server is None or not server.ended)
    if server is not None and not bus.stopping:
        log.error("the Rerun server has exited")
        return 1
    return 0


def _recordings(settings: Settings, server: Server | None) -> Callable[[str], Recording]:
    """How the recording of each next run is made: a file of its own for each."""
    numbers = itertools.count(1)

    def new(run: str) -> Recording:
        sinks: list[rr.LogSinkLike] = [rr.GrpcSink(server.data_url)] if server is not None else []
        if settings.save is not None:
            path = numbered(settings.save, next(numbers))
            log.info("recording", file=str(path))
            sinks.append(rr.FileSink(path))
        return Recording(run, sinks)

    return new


def numbered(path: Path, number: int) -> Path:
    """``run.rrd``, then ``run.2.rrd``, ``run.3.rrd`` …"""
    return path if number == 1 else path.with_name(f"{path.stem}.{number}{path.suffix}")


def next_frame(due: float, begun: float, ended: float, period: float) -> float:
    """Due time of the next frame, all in seconds. On a busy machine a frame takes long, and the next one waits in
    proportion, up to ``LONGEST_REST``: the control loops need the processor more.
    """
    return max(due + period, ended + min(REST * (ended - begun), LONGEST_REST))


class Every:
    """True once in so many seconds, first when they have passed."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._due: float | None = None

    def __call__(self, wall: float) -> bool:
        passed = self._due is not None and wall >= self._due
        if passed or self._due is None:
            self._due = wall + self._seconds
        return passed


class Viewer:
    """Wires the bus to recordings, one a run. ``new_recording``: name of the run → where it is written. Viewers that
    are served keep their layout from run to run; files each need their own (``layout_each_run``).
    """

    def __init__(
        self, bus: Bus, new_recording: Callable[[str], Recording], rate: float, layout_each_run: bool = False
    ) -> None:
        self._bus, self._new_recording, self._period = bus, new_recording, 1.0 / rate
        self._inbox, self._newest = bus.inbox(), bus.newest()
        self._inbox.watch_services()
        newest = newest_topics()
        for topic in drawn_topics():
            if topic not in newest:
                self._inbox.subscribe(topic)
        for topic, keep in newest.items():
            self._newest.follow(topic, keep=keep)
        self._recording: Recording | None = None
        self._picture, self._cast, self._cast_since = Picture(), RobotSet(), 0.0
        self._run: str | None = None  # as the clock names it; None without a clock
        self._now, self._repeated = 0, 0
        self._waiting: list[Event] = []  # before it is known which run it is
        self._waiting_since: float | None = None
        self._timeless: dict[tuple[str, str], Sample] = {}
        self._rows_due, self._repeat_due = Every(ROWS_EVERY), Every(REPEAT_EVERY)
        self._layout: RobotSet | None = None
        self._layout_each_run = layout_each_run

    def run(self, alive: Callable[[], bool] = lambda: True) -> None:
        """Draw until the bus stops, or what is drawn on is not ``alive`` any more. What came by then is drawn."""
        due = time.monotonic()
        while not self._bus.stopping and alive():
            begun = time.monotonic()
            self.frame(begun)
            due = next_frame(due, begun, time.monotonic(), self._period)
            time.sleep(max(0.0, due - time.monotonic()))
        if (recording := self._take_in(time.monotonic())) is not None:
            recording.close()

    def frame(self, wall: float) -> None:
        """Take in what has come, and draw it. ``wall`` is the machine's monotonic time in seconds."""
        recording = self._take_in(wall)
        if recording is None:
            return
        self._lay_out(recording, wall)
        if self._rows_due(wall):
            recording.flush_rows()
        if self._repeat_due(wall) and self._now != self._repeated:  # nothing changes while the simulation is paused
            self._repeated = self._now
            recording.repeat(self._now)

    def _take_in(self, wall: float) -> Recording | None:
        """Record what has come. Returns the recording; None before it is known which run it is of."""
        events = self._read()
        clocks = [event.message for event in events if isinstance(event, Sample) and event.topic is topics.CLOCK]
        if clocks:
            self._now = clocks[-1].stamp
            if clocks[-1].run != self._run:
                self._begin(clocks[-1].run)
        events = self._waiting + events
        self._waiting = []
        if self._recording is None:
            self._wait_for_clock(events, wall)
        else:
            self._recording.write(self._drawn(events))
        return self._recording

    def _lay_out(self, recording: Recording, wall: float) -> None:
        """Once the set of robots has settled: each layout is kept, and replaces what users made of the last."""
        if self._picture.cast != self._cast:
            self._cast, self._cast_since = self._picture.cast, wall
        if self._cast != self._layout and wall - self._cast_since >= SETTLED:
            self._layout = self._cast
            recording.show(blueprint(self._layout))

    def _read(self) -> list[Event]:
        events: list[Event] = []
        while len(events) < READ_AHEAD and (event := self._inbox.get(timeout=0)) is not None:
            events.append(event)
        return [*events, *self._newest.take()]

    def _wait_for_clock(self, events: list[Event], wall: float) -> None:
        """A robot without a simulator may publish no clock; then the stamps are the time."""
        self._waiting = events
        stamped = (isinstance(event, Sample) and hasattr(event.message, "stamp") for event in events)
        if self._waiting_since is None and any(stamped):
            self._waiting_since = wall
        if self._waiting_since is not None and wall - self._waiting_since > CLOCK_PATIENCE:
            self._begin(None)

    def _begin(self, run: str | None) -> None:
        """A new run: another recording, in which the static items are drawn again."""
        if self._recording is not None:
            self._recording.close()
        self._run = run
        self._picture = Picture()
        if self._layout_each_run:
            self._layout = None
        self._recording = self._new_recording(run or "")
        self._recording.write(self._drawn(list(self._timeless.values())))

    def _drawn(self, events: Iterable[Event]) -> Iterable[Stamped]:
        for event in events:
            match event:
                case Sample():
                    yield from self._sample(event)
                case Presence(service=service, alive=alive):
                    yield self._now, presence(service, alive)

    def _sample(self, sample: Sample) -> Iterable[Stamped]:
        topic = sample.topic
        timeless = topic.qos is Qos.LATCHED and topic.rate == 0
        if timeless:
            self._timeless[topic.name, sample.robot] = sample
        stamp = self._stamp(sample.message)
        if stamp is None and not timeless:
            return
        for item in self._picture.on_message(topic, sample.robot, sample.message):
            yield self._now if stamp is None else stamp, item

    def _stamp(self, message: Any) -> int | None:
        """The time of a message; None for a stamp of another run."""
        stamp = int(getattr(message, "stamp", self._now))
        if self._run is not None:
            return stamp if stamp <= self._now + AHEAD else None
        self._now = max(self._now, stamp)
        return stamp
