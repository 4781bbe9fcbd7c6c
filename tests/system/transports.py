"""The ways to an arm, behind one interface: a request in, its answer out; events and streams are kept aside."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import httpx
from websockets.sync.client import connect

from rackhand.bus import Sample
from rackhand.schemas import topics
from rackhand.schemas.motion import CrfCall, SessionGone
from rackhand.services.launch.demo.crf import CrfClient
from tests.system.station import Station

PATIENCE = 60.0  # seconds; only ever bounds a failure
EVENTS = frozenset({"controlGranted", "controlLost", "stopped", "resumed", "heartbeatLost", "streamStatus"})
ARM = "arm1"

Json = dict[str, Any]


class Client(Protocol):
    """One client of the arm."""

    def send(self, raw: str | bytes) -> Json:
        """The answer to one request, whatever it is."""

    def heard(self) -> list[Json]:
        """Events and stream packets that came so far, each once."""


def ask(client: Client, **request: Any) -> Json:
    return client.send(json.dumps(request))


class Transport(Protocol):
    """``connected``: a client is its connection, so that its end is noticed. ``streams``: it carries them."""

    name: str
    connected: bool
    streams: bool

    def client(self) -> Any:
        """A context manager that gives a ``Client`` of its own."""


class _Numbered:
    def __init__(self, station: Station) -> None:
        self.station = station
        self._numbers = itertools.count(1)


class Zenoh(_Numbered):
    """Stops by the key that is for them alone."""

    name, connected, streams = "zenoh", True, True

    @contextmanager
    def client(self) -> Iterator[Client]:
        session = f"zenoh {next(self._numbers)}"
        yield _ZenohClient(self.station, session)
        self.station.bus.publisher(topics.MOTION_SESSION, ARM).put(SessionGone(session=session))


class _ZenohClient:
    def __init__(self, station: Station, session: str) -> None:
        self._bus, self._session = station.bus, session
        self._streams = station.bus.inbox().subscribe(topics.MOTION_STREAM, ARM)
        self._events = station.bus.inbox().subscribe(topics.MOTION_EVENT, ARM)

    def send(self, raw: str | bytes) -> Json:
        text = raw if isinstance(raw, str) else raw.decode("utf-8", "surrogateescape")
        query = topics.MOTION_STOP if '"softStop"' in text or '"hardStop"' in text else topics.MOTION
        answer = self._bus.call(query, CrfCall(session=self._session, text=text), ARM, timeout=PATIENCE)
        return dict(json.loads(answer.text))

    def heard(self) -> list[Json]:
        found: list[Json] = []
        while isinstance(event := self._streams.get(timeout=0.3), Sample):
            if event.message.session == self._session:
                found.append(json.loads(event.message.text))
        while isinstance(event := self._events.get(timeout=0.0), Sample):
            if event.message.to in ("", self._session):
                found.append({"replyCommand": event.message.name, "message": event.message.info.model_dump()})
        return found


class Http(_Numbered):
    """A client is who sends the same X-Client."""

    name, connected, streams = "http", False, False

    @contextmanager
    def client(self) -> Iterator[Client]:
        with httpx.Client(base_url=self.station.cell.http, timeout=PATIENCE, trust_env=False) as http:
            yield _HttpClient(http, f"http {next(self._numbers)}")


class _HttpClient:
    def __init__(self, http: httpx.Client, name: str) -> None:
        self._http, self._name = http, name

    def send(self, raw: str | bytes) -> Json:
        answer = self._http.post(f"/motion/{ARM}/command", content=raw, headers={"X-Client": self._name})
        assert answer.status_code == 200, answer.text
        return dict(answer.json())

    def heard(self) -> list[Json]:
        return []


class _Mixed:
    """Answers and events on one line."""

    def __init__(self) -> None:
        self._heard: list[Json] = []

    def put(self, raw: str | bytes) -> None:
        raise NotImplementedError

    def _receive(self, timeout: float) -> Json:
        raise NotImplementedError

    def answer(self) -> Json:
        while (message := self._receive(PATIENCE))["replyCommand"] in EVENTS:
            self._heard.append(message)
        return message

    def burst(self, texts: list[str]) -> list[Json]:
        """All at once; the answers as they come."""
        for text in texts:
            self.put(text)
        return [self.answer() for _ in texts]

    def send(self, raw: str | bytes) -> Json:
        self.put(raw)
        return self.answer()

    def heard(self) -> list[Json]:
        try:
            while True:
                self._heard.append(self._receive(0.3))
        except TimeoutError:
            found, self._heard = self._heard, []
            return found


class WebSocket(_Numbered):
    name, connected, streams = "websocket", True, True

    @contextmanager
    def client(self) -> Iterator[Client]:
        url = f"{self.station.cell.http.replace('http', 'ws', 1)}/motion/{ARM}/ws"
        with connect(url, open_timeout=PATIENCE, proxy=None, max_queue=None, max_size=None) as connection:
            yield _WebSocketClient(connection)


class _WebSocketClient(_Mixed):
    def __init__(self, connection: Any) -> None:
        super().__init__()
        self._connection = connection

    def put(self, raw: str | bytes) -> None:
        self._connection.send(raw)

    def _receive(self, timeout: float) -> Json:
        return dict(json.loads(self._connection.recv(timeout=timeout)))


class Tcp(_Numbered):
    """CRF's packet framing."""

    name, connected, streams = "tcp", True, True

    @contextmanager
    def client(self) -> Iterator[Client]:
        host, port = self.station.cell.crf[ARM].split(":")
        with CrfClient(host, int(port), writer=3) as connection:
            yield _TcpClient(connection)


class _TcpClient(_Mixed):
    def __init__(self, connection: CrfClient) -> None:
        super().__init__()
        self._connection = connection

    def put(self, raw: str | bytes) -> None:
        self._connection.send(raw)

    def _receive(self, timeout: float) -> Json:
        self._connection.socket.settimeout(timeout)
        return self._connection.receive()


TRANSPORTS: tuple[type[Zenoh] | type[Http] | type[WebSocket] | type[Tcp], ...] = (Zenoh, Http, WebSocket, Tcp)
