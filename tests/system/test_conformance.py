"""The conformance vectors of the CRF protocol (spec motion-controller §10) over every way there is to an arm.

One live cell serves all ways, in lockstep and paused but for what a vector needs: nothing depends on the machine.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tests.joined.checks import ARM, BAD, OK, first_rest, speeds
from tests.system.cell import ROOT
from tests.system.station import Station, pick_station
from tests.system.transports import TRANSPORTS, Client, Http, Json, Transport, ask

HOME = ARM.home.tolist()
FAR = np.array([1.0, 0, 0, 1.0, 1.0, 1.0])  # rad from there, clear of the station
PATH: Json = {"command": "appendPath", "priority": 10, "type": "joints", "data": [HOME]}
REFUSED = {"code": 403, "detail": 0}


@pytest.fixture(scope="module")
def strict(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Station]:
    """A controller as strict as CRF's, of the kind that follows paths only."""
    given = {"RACKHAND_CONTROLLER_STRICT_CRF": "1", "RACKHAND_CONTROLLER_WITHOUT": "setVelocity setTorque"}
    with pick_station(tmp_path_factory.mktemp("strict"), environment=given) as station:
        yield station


@pytest.fixture(params=TRANSPORTS, ids=lambda kind: kind.name)
def way(request: pytest.FixtureRequest, station: Station) -> Transport:
    transport: Transport = request.param(station)
    return transport


@pytest.fixture
def a(way: Transport) -> Iterator[Client]:
    with way.client() as client:
        yield client


@pytest.fixture
def b(way: Transport) -> Iterator[Client]:
    with way.client() as client:
        yield client


def error(message: str | int, answer: Json, **echo: Any) -> None:
    """An error in CRF's form: with this ``id`` if the request had one, else without."""
    assert (answer["command"], answer["replyCommand"], answer["message"]) == ("reply", "error", message), answer
    assert {key: answer[key] for key in ("id",) if key in answer} == echo


def test_1_lock(a: Client) -> None:
    answer = ask(a, command="lockControl", priority=10, id=1)
    assert answer == {"command": "reply", "replyCommand": "lockControl", "message": True, "id": 1}


def test_2_another_client(station: Station, a: Client, b: Client) -> None:
    ask(a, command="lockControl", priority=10)
    assert ask(b, command="lockControl", priority=20)["message"] is False
    assert ask(b, command="lockControl", priority=10)["message"] is False, "equal numbers do not share"
    assert ask(b, **{**PATH, "priority": 20})["message"] == REFUSED
    assert ask(b, command="softStop", priority=20)["message"] == OK
    assert ask(b, command="hardStop")["message"] == OK
    assert ask(a, **PATH)["message"] == {"code": 403, "detail": 2}, "latched until the holder resumes"
    assert ask(a, command="resumeControl", priority=10)["message"] == OK
    assert ask(a, **PATH)["message"] == OK


def test_3_a_path(station: Station, a: Client) -> None:
    goal = (ARM.home + 0.05).tolist()
    assert ask(a, **{**PATH, "data": [goal]}) == {"command": "reply", "replyCommand": "appendPath", "message": OK}
    assert ask(a, command="getStatus")["message"]["isTrajectoryRunning"]["value"] is True
    assert np.abs(np.array(station.advance(2.0)[-1].q) - goal).max() < 1e-3
    status = ask(a, command="getStatus")["message"]
    assert status["isTrajectoryRunning"] == {"value": False, "code": 200, "detail": 0}
    assert status["priorityUnderControl"] == 10


def test_4_wrong_counts_in_two_layers(a: Client) -> None:
    answer = ask(a, **{**PATH, "data": [[0, 0, 0, 0, 0]]}, id="five")
    assert (answer["replyCommand"], answer["message"], answer["id"]) == ("appendPath", BAD, "five")
    error(400, ask(a, **{key: value for key, value in PATH.items() if key != "priority"}, id=4), id=4)
    error(400, ask(a, command="setVelocity", priority=10, type="joints", data=[0.0] * 5))
    assert ask(a, command="getStatus")["message"]["priorityUnderControl"] == 0, "nothing was granted for it"


def test_5_lock_without_a_valid_priority(a: Client) -> None:
    error("Priority not valid", ask(a, command="lockControl", priority=0))
    error("Wrong parameters", ask(a, command="lockControl"))


@pytest.mark.parametrize("id_", [7, None, "x", [1, {"a": None}]])
def test_6_an_unknown_command(a: Client, id_: Any) -> None:
    error("Unknown command: foo", ask(a, command="foo", id=id_), id=id_)


def test_7_streams_that_cannot_be(a: Client) -> None:
    error("Frequency not valid", ask(a, command="startStreamStatus", frequency=0))
    error("Frequency not valid", ask(a, command="startStreamStatus", frequency=1e-320))
    error("Mode not valid", ask(a, command="startStreamStatus", frequency=1.0, mode=0))
    error("Stream was not active", ask(a, command="stopStreamStatus"))


def test_7_a_stream(station: Station, way: Transport, a: Client, b: Client) -> None:
    """HTTP carries none and says so; the other ways tell each client its own, at its rate of simulation time."""
    answer = ask(a, command="startStreamStatus", frequency=20)
    if not way.streams:
        error(405, answer)
        assert "/motion/{arm}/ws" in answer["text"]
        error("Stream was not active", ask(a, command="stopStreamStatus"))
        return
    assert answer["message"] is True
    station.advance(0.5)
    packets = [message for message in a.heard() if message["replyCommand"] == "streamStatus"]
    stamps = [packet["message"]["stamp"] for packet in packets]
    # Where packets come faster than they are taken, a client is told the newest; a tick is 4 ms.
    assert packets and all("id" not in packet for packet in packets)
    assert len(stamps) > 1 and (np.diff(stamps) >= 48_000_000).all()
    assert not [message for message in b.heard() if message["replyCommand"] == "streamStatus"]
    assert ask(a, command="stopStreamStatus")["message"] is True
    a.heard()
    station.advance(0.3)
    assert a.heard() == []


def test_8_a_lock_runs_out(station: Station, a: Client, b: Client) -> None:
    assert ask(a, command="lockControl", priority=1)["message"] is True
    station.advance(9.9)
    assert ask(b, command="getStatus")["message"]["priorityUnderControl"] == 1
    station.advance(0.2)
    assert ask(b, command="getStatus")["message"]["priorityUnderControl"] == 0
    assert ask(a, command="unlockControl", priority=1)["message"] is False


def test_8_what_moves_when_a_lock_runs_out_comes_to_rest(station: Station, a: Client, b: Client) -> None:
    goal = ARM.home + FAR
    assert ask(a, command="lockControl", priority=10, keepAlive=0.5)["message"] is True
    assert ask(a, **{**PATH, "data": [goal.tolist()]})["message"] == OK
    begun = station.advance(0.48)
    assert speeds(begun)[-1] > 0.5, "it moves"
    states = station.advance(1.0)
    assert speeds(states)[-1] < 1e-3 and np.abs(np.array(states[-1].q) - goal).max() > 0.1, "it rests on the way"
    print(f"at rest {first_rest(states, begun[-1].stamp):.0f} ms after 0.48 s of a lock of 0.5 s")
    status = ask(b, command="getStatus")["message"]
    assert status["priorityUnderControl"] == 0 and status["isTrajectoryRunning"]["value"] is False
    assert max(map(abs, status["jointVelocities"]["value"])) < 1e-3
    assert ask(a, command="unlockControl", priority=10)["message"] is False


def test_10_silence_ends_a_velocity(station: Station, a: Client) -> None:
    for _ in range(8):
        assert ask(a, command="setVelocity", priority=10, type="joints", data=[0.2] * 6)["message"] == OK
        station.advance(0.04)
    cut = station.judge.inspect().clock.stamp - 40_000_000
    states = station.advance(0.5)
    speed = speeds(states)
    full = max(s.stamp for s, v in zip(states, speed, strict=True) if v > 0.19)
    assert full - cut <= 112_000_000, "the reference is zero 100 ms after the last command"
    # The last milliradians per second are the joint servo's settling.
    after = [max(v, 5e-3) for s, v in zip(states, speed, strict=True) if s.stamp > cut + 112_000_000]
    assert (np.diff(after) < 1e-4).all() and speed[-1] < 1e-3, "it decays monotonically to nothing"
    codes = ask(a, command="getStatus")["message"]["controllerStatus"]
    assert codes == sorted(set(codes)) and all(type(code) is int for code in codes)


def test_a_client_that_leaves_lets_go(station: Station, way: Transport, b: Client) -> None:
    """HTTP has no connection that could end: there the lock runs out."""
    with way.client() as leaving:
        assert ask(leaving, **{**PATH, "data": [(ARM.home + FAR).tolist()]})["message"] == OK
        station.advance(0.5)
    if not way.connected:
        assert ask(b, command="getStatus")["message"]["priorityUnderControl"] == 10
        return
    station.cell.wait_for(
        lambda: True if station.status()["priorityUnderControl"] == 0 else None, "the controller is told"
    )
    assert speeds(station.advance(1.0))[-1] < 1e-3
    assert ask(b, command="getStatus")["message"]["isTrajectoryRunning"]["value"] is False


def test_an_answer_is_the_same_whatever_carried_it(station: Station) -> None:
    """To the byte of its JSON, for what depends on nobody's state."""
    requests = ('{"command":"getConfiguration","id":[1]}', '{"command":"foo"}', "{", '{"command":"getStatus"}')
    answers = []
    for kind in TRANSPORTS:
        with kind(station).client() as client:
            answers.append([json.dumps(client.send(text)) for text in requests])
    assert len({tuple(each) for each in answers}) == 1


@pytest.mark.parametrize("kind", TRANSPORTS, ids=lambda kind: kind.name)
def test_2_strict_crf_a_stop_needs_priority(strict: Station, kind: Any) -> None:
    with kind(strict).client() as a, kind(strict).client() as b:
        assert ask(a, command="lockControl", priority=10)["message"] is True
        for stop in ("softStop", "hardStop"):
            assert ask(b, command=stop, priority=20)["message"] == REFUSED
            assert ask(b, command=stop, priority=10)["message"] == OK
            error(400, ask(b, command=stop))
        assert ask(a, command="unlockControl", priority=10)["message"] is True


@pytest.mark.parametrize("kind", TRANSPORTS, ids=lambda kind: kind.name)
def test_9_a_path_only_controller(strict: Station, kind: Any) -> None:
    with kind(strict).client() as a:
        for command in ("setVelocity", "setTorque"):
            answer = ask(a, command=command, priority=10, type="joints", data=[0.0] * 6)
            assert (answer["replyCommand"], answer["message"]) == (command, {"code": 405, "detail": 0})
        assert ask(a, **PATH)["message"] == OK
        ask(a, command="unlockControl", priority=10)


def test_the_command_line(station: Station) -> None:
    """``rackhand motion`` against the same cell: the protocol's answer, word for word."""

    def motion(arm: str, text: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "rackhand.services.launch", "motion", arm, text]
        given = [*command, "--state-dir", str(station.cell.state_dir)]
        return subprocess.run(given, cwd=ROOT, capture_output=True, text=True, check=False, timeout=60)

    done = motion("arm1", json.dumps({**PATH, "id": 3}))
    assert (done.returncode, json.loads(done.stdout)) == (
        0, {"command": "reply", "replyCommand": "appendPath", "message": OK, "id": 3},
    )  # fmt: skip
    error("Not valid json format", json.loads(motion("arm1", "{").stdout))
    assert json.loads(motion("arm1", '{"command":"softStop"}').stdout)["message"] == OK
    lost = motion("arm9", "{}")
    assert lost.returncode == 1 and "there is no arm 'arm9'" in lost.stderr
    with Http(station).client() as other:
        assert ask(other, command="getStatus")["message"]["priorityUnderControl"] == 10
