"""Starts the processes of a cell, restarts those that end, and stops them all together."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable, Coroutine, Mapping, Sequence
from contextlib import suppress
from typing import Any

from rackhand.services.launch.child import Child, describe_exit
from rackhand.services.launch.output import Output
from rackhand.services.launch.processes import Address, Process
from rackhand.services.launch.restarts import GiveUp, History, RestartPolicy, after_exit

SELF = "launch"
GRACE = 5.0  # seconds between "please end" and the kill
IMPATIENT = 1.0  # a second signal within this many seconds is the same one, sent to a group and to its leader

Watch = Callable[["Supervisor"], Coroutine[Any, Any, None]]


class Supervisor:
    """Keeps ``processes`` running until a signal, or until one of them can never start.

    ``watch`` runs beside them (waiting for "ready", say) and is cancelled at the end. ``on_change`` is called with the
    pids by name whenever they change. Everything happens in one asyncio loop in the main thread: the kernel ends a
    guarded child with the *thread* that started it.
    """

    def __init__(
        self,
        processes: Sequence[Process],
        environment: Mapping[str, str],
        *,
        policy: RestartPolicy = RestartPolicy(),  # noqa: B008 - it is frozen
        grace: float = GRACE,
        watch: Watch | None = None,
        on_change: Callable[[dict[str, int]], None] = lambda _: None,
    ) -> None:
        self._processes = processes
        self._environment = environment
        self._policy = policy
        self._grace = grace
        self._watch = watch
        self._on_change = on_change
        self._output = Output([SELF, *(p.name for p in processes)])
        self._children: dict[str, Child] = {}
        self._started = {p.name: asyncio.Event() for p in processes}
        self._stop = asyncio.Event()
        self._asked_at = 0.0
        self._exit_code = 0

    def say(self, text: str) -> None:
        """A line of the supervisor's own."""
        self._output.line(SELF, text)

    def show_status(self, text: str) -> None:
        """Below the lines of a terminal, until the next one; empty for none."""
        self._output.status(text)

    async def run(self) -> int:
        """Returns the exit code: 0 after a signal asked it to stop, 1 when a process can never start."""
        self._output.on_closed = self._stop.set
        self._listen_for_signals()
        keepers = [asyncio.create_task(self._keep(process)) for process in self._processes]
        watcher = asyncio.create_task(self._watch(self)) if self._watch else None
        for keeper, process in zip(keepers, self._processes, strict=True):
            if not process.optional:
                keeper.add_done_callback(lambda _: self._stop.set())  # none ends by itself, except to give up
        try:
            await self._stop.wait()
        finally:
            self.show_status("")
            if watcher is not None:
                watcher.cancel()
                with suppress(asyncio.CancelledError):
                    await watcher
            await self._end(keepers)
        return self._exit_code

    def _listen_for_signals(self) -> None:
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is not signal.SIG_IGN or number is not signal.SIGHUP:  # nohup stays nohup
                loop.add_signal_handler(number, self._asked_to_stop, number)

    def _asked_to_stop(self, number: signal.Signals) -> None:
        now = asyncio.get_running_loop().time()
        if not self._stop.is_set():
            self.say(f"{number.name}: stopping")
            self._asked_at = now
            self._stop.set()
        elif now - self._asked_at > IMPATIENT:
            self.say(f"{number.name} again: killing the remaining processes")
            self._signal_all(signal.SIGKILL)

    async def _keep(self, process: Process) -> None:
        """Start ``process`` when what it needs is there, and again whenever it ends."""
        for name in process.needs:
            await self._unless_stopped(self._started[name].wait())
        history = History()
        while not self._stop.is_set():
            code, ran_for = await self._run_once(process)
            if self._stop.is_set():
                return
            history, verdict = after_exit(self._policy, history, ran_for, code)
            if isinstance(verdict, GiveUp):
                self._give_up(process, code, verdict)
                return
            self.say(f"{process.name} ended with {describe_exit(code)}; restarting in {verdict:g} s")
            await self._unless_stopped(asyncio.sleep(verdict))

    def _give_up(self, process: Process, code: int, verdict: GiveUp) -> None:
        said = "continuing without it" if process.optional else "giving up"
        self.say(f"{process.name} ended with {describe_exit(code)}; {said}: {verdict.why}")
        if not process.optional:
            self._exit_code = 1
            self._stop.set()

    async def _run_once(self, process: Process) -> tuple[int, float]:
        child = await Child.start(process, self._environment, lambda line: self._output.line(process.name, line))
        self._children[process.name] = child
        self._on_change({name: each.pid for name, each in self._children.items()})
        if self._stop.is_set():  # asked for while it was being started: it has not got the signal yet
            child.signal(signal.SIGTERM)
        opening = asyncio.create_task(self._mark_started(process))
        try:
            return await child.wait()
        finally:
            opening.cancel()
            del self._children[process.name]

    async def _mark_started(self, process: Process) -> None:
        needed = any(process.name in other.needs for other in self._processes)
        while needed and process.listens is not None and not await accepts_connections(process.listens):
            await asyncio.sleep(0.05)
        self._started[process.name].set()

    async def _unless_stopped(self, something: Coroutine[Any, Any, object]) -> None:
        """Wait for something, or for the stop, whichever is first."""
        tasks = {asyncio.create_task(something), asyncio.create_task(self._stop.wait())}
        _, pending = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in pending:
            task.cancel()

    async def _end(self, keepers: Sequence[asyncio.Task[None]]) -> None:
        """SIGTERM to all, a bounded wait, SIGKILL to what is left."""
        self._signal_all(signal.SIGTERM)
        _, pending = await asyncio.wait(keepers, timeout=self._grace)
        if pending:
            self.say(f"still running after {self._grace:g} s, killed: {', '.join(sorted(self._children))}")
            self._signal_all(signal.SIGKILL)
            await asyncio.wait(pending)
        self.say("stopped")
        for keeper in keepers:
            keeper.result()  # an error of the supervisor's own is not swallowed

    def _signal_all(self, number: signal.Signals) -> None:
        for child in self._children.values():
            child.signal(number)


async def accepts_connections(address: Address) -> bool:
    try:
        _, writer = await asyncio.open_connection(address.host, address.port)
    except OSError:
        return False
    writer.close()
    with suppress(OSError):
        await writer.wait_closed()
    return True
