"""The connection to the chassis API: it waits for frames, says what it saw, and outlasts a gateway that closes it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from rackhand.schemas import topics
from rackhand.services.launch.api_connection import ApiConnection, NoAnswer, NotInTime, is_jack_at
from rackhand.testing.ports import free_port
from tests.gateway import messages
from tests.gateway.harness import Gateway, running_gateway

PATIENCE = 20.0  # s; only ever bounds a failure


@pytest.fixture(scope="module")
def gateway() -> Iterator[Gateway]:
    with running_gateway() as gateway:
        yield gateway


@pytest.fixture
def connection(gateway: Gateway) -> Iterator[ApiConnection]:
    with ApiConnection(gateway.url, ["/jack_state"]) as connection:
        yield connection


def test_it_waits_until_a_frame_is_as_wanted_and_tells_what_it_saw_meanwhile(
    gateway: Gateway, connection: ApiConnection
) -> None:
    gateway.publish(topics.JACK, messages.jack("jacking_up", 0.4))
    seen = []

    def waiting(jack: dict[str, object]) -> None:
        seen.append(jack["progress"])
        gateway.publish(topics.JACK, messages.jack("hold", 1.0))

    found = connection.wait("/jack_state", lambda jack: is_jack_at(jack, "up"), PATIENCE, waiting)
    assert (found["state"], found["progress"], seen[0]) == ("hold", 1.0, pytest.approx(0.4))


def test_what_never_comes_is_an_error_with_the_newest_frame(gateway: Gateway, connection: ApiConnection) -> None:
    gateway.publish(topics.JACK, messages.jack("hold", 0.0))
    connection.wait("/jack_state", lambda jack: is_jack_at(jack, "down"), PATIENCE)
    with pytest.raises(NotInTime) as late:
        connection.wait("/jack_state", lambda jack: is_jack_at(jack, "up"), 0.0)
    assert late.value.seen is not None and late.value.seen["progress"] == 0.0


def test_a_closed_connection_is_opened_anew(gateway: Gateway, connection: ApiConnection) -> None:
    gateway.publish(topics.JACK, messages.jack("hold", 0.0))
    assert connection.send("GET", "/chassis/moves")[0] == 200
    connection.wait("/jack_state", lambda jack: is_jack_at(jack, "down"), PATIENCE)
    assert connection._socket is not None
    connection._socket.close()
    connection._http.sock.close()
    gateway.publish(topics.JACK, messages.jack("hold", 1.0))
    connection.wait("/jack_state", lambda jack: is_jack_at(jack, "up"), PATIENCE)
    assert connection.send("GET", "/chassis/moves")[0] == 200


def test_where_nobody_listens_the_error_names_the_request() -> None:
    with (
        ApiConnection(f"http://127.0.0.1:{free_port()}", []) as connection,
        pytest.raises(NoAnswer, match="GET /chassis/moves: the gateway does not answer"),
    ):
        connection.send("GET", "/chassis/moves")
