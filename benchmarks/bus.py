"""Round trip of a small message between two processes: the typed bus, bare Zenoh, and a bare TCP socket as floor.

The variants take turns in short rounds of one run, so that the machine's noise meets all alike.
"""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack

import zenoh

from benchmarks.report import Report, median, percentile
from rackhand.bus import Bus, BusConfig, Sample
from rackhand.schemas import topics
from rackhand.schemas.base import Pose2, Twist2
from rackhand.schemas.chassis import ChassisCommand, Odometry
from rackhand.schemas.codec import codec_for
from rackhand.schemas.service import WORLD, ServiceId
from rackhand.testing.ports import free_port

ROUNDS, PINGS = 20, 150
BARE_PING, BARE_PONG = "rackhand/bench/ping", "rackhand/bench/pong"
SETTINGS = {"express": True, "congestion_control": zenoh.CongestionControl.BLOCK}

Ping = Callable[[int], None]


def odometry(stamp: int) -> Odometry:
    return Odometry(
        stamp=stamp,
        pose=Pose2(x=1.25, y=-3.5, yaw=0.7),
        twist=Twist2(linear=0.8, angular=0.1),
        wheel_velocities=(9.5, 10.5),
    )


PAYLOAD = codec_for(Odometry).dumps(odometry(1))


def run() -> Report:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    tcp_port = free_port()
    router = subprocess.Popen([sys.executable, "-m", "rackhand.bus.router", "--listen", endpoint])
    echo = subprocess.Popen([sys.executable, "-m", "benchmarks.bus", endpoint, str(tcp_port)])
    try:
        with ExitStack() as stack:
            variants = {
                "bare TCP socket": tcp_ping(stack, tcp_port),
                "bare Zenoh, FIFO thread": bare_ping(stack, endpoint),
                "rackhand bus, validated models": bus_ping(stack, endpoint),
            }
            times: dict[str, list[float]] = {name: [] for name in variants}
            stamp = 0
            for _ in range(ROUNDS):
                for name, ping in variants.items():
                    for _ in range(PINGS):
                        stamp += 1
                        begun = time.perf_counter()
                        ping(stamp)
                        times[name].append(time.perf_counter() - begun)
    finally:
        for process in (echo, router):
            process.terminate()
            process.wait(timeout=10)
    bare = median(times["bare Zenoh, FIFO thread"])
    rows = [
        (name, f"{median(t) * 1e6:.0f}", f"{percentile(t, 0.99) * 1e6:.0f}", f"{median(t) / bare:.2f}")
        for name, t in times.items()
    ]
    return Report(
        "Bus round trip",
        "python -m benchmarks bus",
        ("variant", "median µs", "p99 µs", "ratio to bare Zenoh"),
        rows,
        f"Two processes on loopback, {len(PAYLOAD)}-byte odometry out, command back, {ROUNDS * PINGS} pings each in "
        f"{ROUNDS} interleaved rounds. The bus encodes, validates and routes both ways; the others move bytes.",
    )


def tcp_ping(stack: ExitStack, port: int) -> Ping:
    while True:
        try:
            link = stack.enter_context(socket.create_connection(("127.0.0.1", port)))
            break
        except ConnectionRefusedError:
            time.sleep(0.05)
    link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def ping(_stamp: int) -> None:
        link.sendall(PAYLOAD)
        link.recv(len(PAYLOAD), socket.MSG_WAITALL)

    return ping


def bare_ping(stack: ExitStack, endpoint: str) -> Ping:
    session = stack.enter_context(zenoh.open(BusConfig(connect=endpoint).zenoh_config()))
    pong = session.declare_subscriber(BARE_PONG, zenoh.handlers.FifoChannel(16))
    publisher = session.declare_publisher(BARE_PING, **SETTINGS)
    while publisher.matching_status.matching is False:
        time.sleep(0.05)

    def ping(_stamp: int) -> None:
        publisher.put(PAYLOAD)
        pong.recv().payload.to_bytes()

    return ping


def bus_ping(stack: ExitStack, endpoint: str) -> Ping:
    bus = stack.enter_context(Bus(ServiceId("sim", WORLD), BusConfig(connect=endpoint)))
    inbox = bus.inbox().subscribe(topics.COMMAND, "amr1")
    publisher = bus.publisher(topics.ODOMETRY, "amr1")
    answer = None
    while answer is None:
        publisher.put(odometry(0))
        answer = inbox.get(timeout=0.2)

    def ping(stamp: int) -> None:
        publisher.put(odometry(stamp))
        event = inbox.get()
        while isinstance(event, Sample) and event.message.answers != stamp:
            event = inbox.get()

    return ping


def echo(endpoint: str, tcp_port: int) -> None:
    """The other process: answers all three kinds."""
    import threading

    def tcp() -> None:
        with socket.create_server(("127.0.0.1", tcp_port)) as server:
            link, _ = server.accept()
            link.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            while data := link.recv(len(PAYLOAD), socket.MSG_WAITALL):
                link.sendall(data)

    threading.Thread(target=tcp, daemon=True).start()
    with (
        zenoh.open(BusConfig(connect=endpoint).zenoh_config()) as session,
        Bus(ServiceId("planner", "amr1"), BusConfig(connect=endpoint)) as bus,
    ):
        bus.handle_signals()
        pings = session.declare_subscriber(BARE_PING, zenoh.handlers.FifoChannel(16))
        pong = session.declare_publisher(BARE_PONG, **SETTINGS)

        def bare() -> None:
            for sample in pings:
                pong.put(sample.payload.to_bytes())

        thread = threading.Thread(target=bare)
        thread.start()
        command = bus.publisher(topics.COMMAND, "amr1")
        for event in bus.inbox().subscribe(topics.ODOMETRY, "amr1"):
            assert isinstance(event, Sample)
            command.put(ChassisCommand(answers=event.message.stamp, twist=Twist2(linear=0.0, angular=0.0)))
        pings.undeclare()
        thread.join()


if __name__ == "__main__":
    echo(sys.argv[1], int(sys.argv[2]))
