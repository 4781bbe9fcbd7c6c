"""Priority access where it counts, at the joints: random clients share a real controller with a perfect arm.

The machine's own model is in ``access/test_access_model.py``; here the guarantees are checked on what the joints do.
"""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from rackhand.schemas.fencing import FencingGuard
from rackhand.schemas.motion import ArmCommand
from rackhand.services.controller.protocol.sessions import alias
from tests.controller.cell import PERIOD_NS, UR5E, PerfectArm

CLIENTS = st.sampled_from(["a", "b", "c"])
PRIORITIES = st.sampled_from([1, 5, 5, 20])
STEPS_MS = st.sampled_from([4, 4, 40, 120, 400])
KEEP_ALIVE_S = 0.6
DEADMAN_S, RAMP_S = 0.1, 0.3
BRAKING_S = 0.6  # more than any stop takes from these speeds
GOALS = [(UR5E.home + shift).tolist() for shift in (-0.6, 0.1, 0.7)]


class SharedArm(RuleBasedStateMachine):
    """``asked_by``: whose accepted command the arm may be carrying out; the last hop sees every joint command."""

    def __init__(self) -> None:
        super().__init__()
        self.arm = PerfectArm(keep_alive_ns=int(KEEP_ALIVE_S * 1e9))
        # So slow that a path outlives every lock: what ends it is its loss.
        self.arm.ok("setup", command="setProfileVelocity", type="joints", data=[0.2] * 6)
        assert self.arm.ask("setup", command="unlockControl", priority=10)["message"] is True
        self.hop = FencingGuard()
        self.sent: list[ArmCommand] = []
        self.texts: list[tuple[str, str]] = []
        self.free_since: int | None = 0  # when the arm was last left without anybody to move it
        self.referred_at: int | None = None  # when the velocity came that the arm follows last
        self.granted: set[tuple[str, str]] = set()

    # -- time ---------------------------------------------------------------------------------------------------------

    @rule(ms=STEPS_MS)
    def time_passes(self, ms: int) -> None:
        for _ in range(ms * 1_000_000 // PERIOD_NS):
            self.arm.advance(0.004)
            command = self.arm.command
            assert command is not None and self.hop.admit(command.token, command.answers), "the newest was not let by"
            self.sent.append(command)
            self.watch()
        del self.sent[:-200]

    @precondition(lambda self: not self.arm.controller.motion.standing)
    @rule()
    def silence(self) -> None:
        """Nobody says anything while the arm moves: every lock runs out, and it comes to rest on the way."""
        self.time_passes(int((KEEP_ALIVE_S + BRAKING_S) * 1000) + 100)
        assert self.holder() is None and np.abs(self.arm.dq).max() < 1e-6, "it moves for nobody"

    def watch(self) -> None:
        """After expiry, a stop or a departure nothing moves once the arm had time to brake."""
        if self.free_since is not None and self.arm.stamp - self.free_since > BRAKING_S * 1e9:
            assert np.abs(self.arm.dq).max() < 1e-6, "it moves, and nobody asked it to"
        if self.referred_at is not None and self.arm.stamp - self.referred_at > (DEADMAN_S + RAMP_S) * 1e9:
            assert np.abs(self.arm.dq).max() < 1e-6, "a velocity outlived its deadman"
        if self.holder() is None and self.free_since is None:
            self.free_since = self.arm.stamp

    def holder(self) -> str | None:
        held = self.arm.controller.access.holder(self.arm.stamp)
        return held.client if held else None

    # -- requests -----------------------------------------------------------------------------------------------------

    def send(self, session: str, **request: Any) -> dict[str, Any]:
        return self.send_text(session, json.dumps(request))

    def send_text(self, session: str, text: str) -> dict[str, Any]:
        """Every request gets one answer: paths behind another one when that is on its way, everything else at once."""
        before, held = self.holder(), self.arm.controller.access.holder(self.arm.stamp)
        ticket = self.arm.send(session, text)
        self.arm.controller.poll()
        self.arm.take()
        request, free_since = json.loads(text), self.free_since
        now = self.arm.controller.access.holder(self.arm.stamp)
        refreshed = now is not None and now.client == alias(session) and now.lease_age == 0
        if refreshed and request["command"] == "appendPath":
            self.free_since = None  # it may be driven before it is answered
            while ticket not in self.arm.answers and self.arm.controller.busy:
                self.time_passes(4)
        answer = self.arm.answers[ticket]
        granted = isinstance(answer["message"], dict) and answer["message"].get("code") == 200
        if not granted:
            self.free_since = free_since
        elif request["command"] in ("appendPath", "setVelocity"):
            # A path that is sent again is answered as the first time, and does nothing.
            assert refreshed or (session, text) in self.granted
            if refreshed:
                assert before in (None, alias(session)) or (held and request["priority"] < held.priority), "foreign"
                self.free_since = None
                self.referred_at = self.arm.stamp if request["command"] == "setVelocity" else None
            self.granted.add((session, text))
        return answer

    @rule(client=CLIENTS, priority=PRIORITIES, goal=st.sampled_from(GOALS), number=st.integers(0, 3))
    def path(self, client: str, priority: int, goal: list[float], number: int) -> None:
        text = json.dumps(
            {"command": "appendPath", "priority": priority, "type": "joints", "data": [goal], "id": number}
        )
        self.texts.append((client, text))
        self.send_text(client, text)

    @rule(client=CLIENTS, priority=PRIORITIES, speed=st.sampled_from([-0.4, 0.2, 0.5]))
    def velocity(self, client: str, priority: int, speed: float) -> None:
        text = json.dumps({"command": "setVelocity", "priority": priority, "type": "joints", "data": [speed] * 6})
        self.texts.append((client, text))
        self.send_text(client, text)

    @precondition(lambda self: self.texts)
    @rule(data=st.data())
    def replayed(self, data: st.DataObject) -> None:
        """A request comes a second time: it moves the arm only as a new one of that client might."""
        self.send_text(*data.draw(st.sampled_from(self.texts[-6:])))

    @rule(client=CLIENTS, priority=PRIORITIES, on_loss=st.sampled_from([None, "softStop", "hold"]))
    def lock(self, client: str, priority: int, on_loss: str | None) -> None:
        extra = {"onLoss": on_loss} if on_loss else {}
        self.send(client, command="lockControl", priority=priority, **extra)

    @rule(client=CLIENTS, kind=st.sampled_from(["softStop", "hardStop"]))
    def stop(self, client: str, kind: str) -> None:
        """Never refused, and effective: whatever moves now is at rest when it had time to brake."""
        answer = self.send(client, command=kind)
        assert answer["message"] == {"value": True, "code": 200, "detail": 0}
        self.free_since = self.arm.stamp

    @rule(client=CLIENTS, priority=PRIORITIES)
    def resume(self, client: str, priority: int) -> None:
        if self.send(client, command="resumeControl", priority=priority)["message"].get("code") == 200:
            self.free_since = self.referred_at = None  # what was held may go on

    @rule(client=CLIENTS)
    def leaves(self, client: str) -> None:
        was_holder = self.holder() == alias(client)
        self.arm.controller.disconnected(client)
        self.arm.take()
        if was_holder and self.holder() is None:
            self.free_since = self.arm.stamp

    @rule()
    def crash(self) -> None:
        """The driver goes and comes back: a new epoch, nobody's arm, standing."""
        self.arm.controller.reset("crash")
        self.arm.halt()
        self.arm.command = None
        self.arm.advance(0.0)
        assert self.holder() is None
        self.free_since = self.arm.stamp - int(BRAKING_S * 1e9)

    @precondition(lambda self: self.sent)
    @rule(data=st.data())
    def late_command(self, data: st.DataObject) -> None:
        """A joint command of the past comes again at the last hop."""
        command = data.draw(st.sampled_from(self.sent))
        if self.hop.admit(command.token, command.answers):
            newest = self.sent[-1]
            assert (command.token, command.answers) == (newest.token, newest.answers), "a stale command moved a joint"

    # -- what always holds --------------------------------------------------------------------------------------------

    @invariant()
    def nothing_failed(self) -> None:
        assert self.arm.errors == []

    def teardown(self) -> None:
        """Left alone, every lock runs out and the arm comes to rest."""
        self.silence()


# A run drives the controller for seconds, so they are fewer than of the machine alone.
ASKED = os.environ.get("RACKHAND_FUZZ_EXAMPLES")
SharedArm.TestCase.settings = settings(
    max_examples=int(ASKED or 40),
    stateful_step_count=20,
    deadline=None,
    derandomize=ASKED is None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
TestSharedArm = SharedArm.TestCase
