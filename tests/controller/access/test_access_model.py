"""Priority access under everything at once: random clients, time, crashes, late and replayed samples.

``RACKHAND_FUZZ_EXAMPLES`` sets the number of runs. The rules hold no copy of the machine: the ledger is kept from the
events it publishes, the arm from its motion effects, and the guarantees are checked on those.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from rackhand.schemas.fencing import FencingGuard
from rackhand.schemas.motion import FencingToken
from rackhand.services.controller.access.access import Access
from rackhand.services.controller.access.streams import StreamGuard, StreamSample
from rackhand.services.controller.access.types import (
    SECOND,
    AccessConfig,
    AccessInput,
    AtRest,
    Beat,
    Caller,
    Command,
    ContinueMotion,
    Disconnected,
    Lock,
    Outcome,
    StartBeat,
    Stop,
    StopMotion,
    Tick,
    Unlock,
)

CLIENTS = st.sampled_from(["a", "b", "c", "d"])
PRIORITIES = st.sampled_from([1, 5, 5, 10, 20])
KEEP_ALIVE = st.sampled_from([None, SECOND // 2, 3 * SECOND])
ON_LOSS = st.sampled_from([None, None, "softStop", "finishPath", "hold"])
STEPS_MS = st.sampled_from([1, 4, 20, 100, 400, 1500, 6000, 11000])
FORCE_ROLE = "supervisor"


@dataclass
class Lease:
    """The holder as the events tell it, with what it asked for."""

    client: str
    priority: int
    lease: int
    refreshed: int
    keep_alive: int
    on_loss: str


@dataclass(frozen=True)
class ArmSample:
    """What a controller of some time sent to the joints."""

    token: FencingToken
    answers: int


class PriorityAccess(RuleBasedStateMachine):
    def __init__(self) -> None:
        super().__init__()
        self.config = AccessConfig(force_roles=frozenset({FORCE_ROLE}))
        self.now = 0
        self.boots = 0
        self.sent: list[ArmSample] = []
        self.commands: list[Command] = []
        self.tokens: list[tuple[str, FencingToken]] = []
        self.hop = FencingGuard()
        self.start()

    def start(self) -> None:
        self.boots += 1
        self.access = Access(f"boot{self.boots}", self.config)
        self.guard = StreamGuard()
        self.lease: Lease | None = None
        self.mover: str | None = None  # whose command the arm carries out
        self.reference_at: int | None = None  # when the stream was last refreshed
        self.sequences: dict[FencingToken, int] = {}
        self.last_serial = 0
        self.asked: dict[tuple[str, int], tuple[int, int, str]] = {}
        self.hop.raise_to(self.access.token)

    # -- what the outside sees ----------------------------------------------------------------------------------------

    def do(self, happened: AccessInput) -> Outcome:
        before = self.access.token
        outcome = self.access.handle(happened, self.now)
        lost_reasons = self.follow_events(outcome)
        self.follow_effects(outcome, lost_reasons)
        after = self.access.token
        assert after.lease >= before.lease
        if outcome.events and any(e.name in ("controlGranted", "controlLost") for e in outcome.events):
            assert after.lease > before.lease, "every change of holder has a number of its own"
        assert self.hop.raise_to(after)
        return outcome

    def follow_events(self, outcome: Outcome) -> list[tuple[str, str, str]]:
        lost = []
        for event in outcome.events:
            if event.name == "controlLost":
                assert self.lease and event.info.client == self.lease.client, "only the holder loses control"
                lost.append((self.lease.client, str(event.info.reason), self.lease.on_loss))
                self.lease = None
            elif event.name == "controlGranted":
                assert self.lease is None, f"two holders: {self.lease} and {event.info.client}"
                key = (event.info.client, event.info.priority)
                default = (self.now, self.config.keep_alive_ns, self.config.on_loss)
                at, keep_alive, on_loss = self.asked.get(key, default)
                self.lease = Lease(*key, event.info.lease_id, at, keep_alive, on_loss)
        return lost

    def follow_effects(self, outcome: Outcome, lost: list[tuple[str, str, str]]) -> None:
        mover = self.mover
        for effect in outcome.motion:
            assert effect.serial > self.last_serial
            self.last_serial = effect.serial
            if isinstance(effect, StopMotion):
                self.mover = self.reference_at = None
                self.guard.stop(self.now)
            else:
                assert isinstance(effect, ContinueMotion)
        for client, reason, on_loss in lost:
            if mover == client and reason in ("expired", "disconnected", "heartbeat") and on_loss != "finishPath":
                assert any(isinstance(effect, StopMotion) for effect in outcome.motion), f"{reason} without a stop"

    def live(self) -> Lease | None:
        """The holder whose time has not run out."""
        lease = self.lease
        return lease if lease and self.now - lease.refreshed <= lease.keep_alive else None

    # -- what happens -------------------------------------------------------------------------------------------------

    @rule(ms=STEPS_MS)
    def time_passes(self, ms: int) -> None:
        self.now += ms * 1_000_000
        self.do(Tick())
        assert self.lease is None or self.live(), "an expired lock was kept"

    @rule(
        client=CLIENTS,
        priority=PRIORITIES,
        keep_alive=KEEP_ALIVE,
        on_loss=ON_LOSS,
        takeover=st.sampled_from(["stop", "stop", "continue"]),
        force=st.booleans(),
        role=st.sampled_from(["", "", FORCE_ROLE]),
    )
    def lock(self, client: str, priority: int, takeover: Any, force: bool, role: str, **wish: Any) -> None:
        self.do(Tick())
        held, key, mover = self.live(), (client, priority), self.mover
        same = held and (held.client, held.priority) == key
        previous = (held.keep_alive, held.on_loss) if held and same else (10 * SECOND, "softStop")
        keep_alive = wish["keep_alive"] or previous[0]
        self.asked[key] = (self.now, keep_alive, wish["on_loss"] or previous[1])
        outcome = self.do(
            Lock(Caller(client, role=role), priority, wish["keep_alive"], wish["on_loss"], takeover, force)
        )
        forced = force and role == FORCE_ROLE
        allowed = held is None or same or priority < held.priority or forced
        assert outcome.decision.ok == bool(allowed)
        if allowed:
            assert self.lease and (self.lease.client, self.lease.priority) == key
            self.lease.refreshed, self.lease.keep_alive, self.lease.on_loss = self.asked[key]
            if not same or takeover == "continue":
                self.check_takeover(outcome, client, mover, takeover)
            assert outcome.decision.token
            self.tokens.append((client, outcome.decision.token))

    def check_takeover(self, outcome: Outcome, client: str, mover: str | None, takeover: str) -> None:
        if mover not in (None, client):
            stopped = any(isinstance(effect, StopMotion) and effect.clear for effect in outcome.motion)
            assert stopped == (takeover == "stop"), "a foreign queue is cleared, unless it is taken over explicitly"
            if not stopped:
                self.mover = client

    @rule(client=CLIENTS, priority=PRIORITIES)
    def unlock(self, client: str, priority: int) -> None:
        self.do(Tick())
        held = self.live()
        self.do(Unlock(Caller(client), priority))
        if held and (held.client, held.priority) == (client, priority):
            assert self.lease is None or self.lease.lease > held.lease
        else:
            assert self.lease is held, "nobody unlocks for another"

    @rule(client=CLIENTS, priority=PRIORITIES, data=st.data())
    def command(self, client: str, priority: int, data: st.DataObject) -> None:
        mine = [token for owner, token in self.tokens if owner == client]
        token = data.draw(st.sampled_from([None, *mine[-4:]]))
        resumes = data.draw(st.sampled_from([False, False, False, True]))
        self.carry_out(
            Command(
                Caller(client),
                "resumeControl" if resumes else "appendPath",
                priority,
                moves=not resumes,
                resumes=resumes,
                epoch=token.epoch if token else None,
                lease=token.lease if token else None,
            )
        )

    @precondition(lambda self: self.commands)
    @rule(data=st.data())
    def replayed_command(self, data: st.DataObject) -> None:
        """A request comes a second time, any time later, even after a restart."""
        self.carry_out(data.draw(st.sampled_from(self.commands[-8:])))

    def carry_out(self, command: Command) -> None:
        client, priority = command.caller.client, command.priority
        self.do(Tick())
        held, mover, stopped_by = self.live(), self.mover, self.access.stopped_by
        key = (client, priority)
        same = held is not None and (held.client, held.priority) == key
        asked = self.asked.get(key)
        if not same:
            self.asked[key] = (self.now, self.config.keep_alive_ns, self.config.on_loss)
        before = self.access.token
        outcome = self.do(command)
        decision = outcome.decision
        if not decision.ok:
            if asked is not None:
                self.asked[key] = asked  # what it waits with since its lock was refused
            assert not outcome.motion and not outcome.events and self.access.token == before
            return
        assert held is None or same or priority < held.priority, f"{key} moved the arm while {held} lives"
        if command.lease is not None:
            assert held and held.client == client and command.epoch == before.epoch and command.lease == before.lease
        assert stopped_by in (None, client) or command.resumes, "a latched stop was moved away"
        assert self.lease and decision.token == self.access.token
        self.lease.refreshed = self.now
        if command.moves or not same:
            self.check_takeover(outcome, client, mover, command.takeover)
        assert decision.serial >= self.last_serial
        self.last_serial = decision.serial
        if command.moves or any(isinstance(effect, ContinueMotion) for effect in outcome.motion):
            self.mover = client
        self.commands.append(command)
        self.tokens.append((client, decision.token))

    @precondition(lambda self: self.lease)
    @rule(sequence=st.integers(0, 6), age_ms=st.sampled_from([None, 0, 50, 150, 5000]))
    def stream_sample(self, sequence: int, age_ms: int | None) -> None:
        """A velocity of the holder arrives: in order, late, or a second time."""
        token = self.access.token
        stamp = None if age_ms is None else self.now - age_ms * 1_000_000
        if self.guard.offer(StreamSample(token, sequence, stamp), self.now).ok:
            assert sequence > self.sequences.get(token, -1), "a sample was taken twice or out of order"
            assert age_ms in (None, 0, 50), "a stale sample was taken"
            self.sequences[token] = sequence
            self.reference_at = self.now

    @rule(client=CLIENTS, kind=st.sampled_from(["softStop", "hardStop"]), priority=st.none() | PRIORITIES)
    def stop(self, client: str, kind: Any, priority: int | None) -> None:
        outcome = self.do(Stop(Caller(client), kind, priority))
        assert outcome.decision.ok, "a stop was refused"
        effect = outcome.motion[-1]
        assert isinstance(effect, StopMotion) and effect.kind == kind and effect.clear
        assert self.mover is None
        if self.lease and self.lease.client == client:
            self.lease.refreshed = self.now
        else:
            assert self.access.stopped_by in (client, "")

    @rule(client=CLIENTS, period=st.sampled_from([SECOND // 10, 2 * SECOND]))
    def start_heartbeat(self, client: str, period: int) -> None:
        self.do(StartBeat(Caller(client), period))
        self.refreshed_by(client)

    @rule(client=CLIENTS)
    def heartbeat(self, client: str) -> None:
        if self.do(Beat(Caller(client))).decision.ok:
            self.refreshed_by(client)

    def refreshed_by(self, client: str) -> None:
        if self.lease and self.lease.client == client:
            self.lease.refreshed = self.now

    @rule(client=CLIENTS)
    def disconnect(self, client: str) -> None:
        self.do(Tick())
        mover, held = self.mover, self.live()
        finishes = held and held.client == client and held.on_loss == "finishPath"
        self.do(Disconnected(client))
        assert self.lease is None or self.lease.client != client
        if mover == client and not finishes:
            assert self.mover is None, "the client is gone and the arm moves on"

    @rule(late=st.integers(0, 3))
    def rest(self, late: int) -> None:
        """The arm reports rest, perhaps of some effects ago."""
        serial = max(self.last_serial - late, 0)
        self.do(AtRest(serial))
        if serial == self.last_serial:
            self.mover = None

    @rule()
    def crash(self) -> None:
        self.start()
        assert self.access.holder(self.now) is None and self.access.priority_under_control == 0

    @rule()
    def control_cycle(self) -> None:
        """The controller sends the joints what it has, under the token of now."""
        sample = ArmSample(self.access.token, self.now)
        assert self.hop.admit(sample.token, sample.answers)
        self.sent.append(sample)

    @precondition(lambda self: self.sent)
    @rule(data=st.data())
    def late_or_replayed_sample(self, data: st.DataObject) -> None:
        sample = data.draw(st.sampled_from(self.sent))
        if self.hop.admit(sample.token, sample.answers):
            assert sample.token == self.access.token, "a sample of a lost lease moved a joint"
            newest = max(s.answers for s in self.sent if s.token == sample.token)
            assert sample.answers == newest, "an older sample moved a joint"

    # -- what always holds --------------------------------------------------------------------------------------------

    @invariant()
    def one_holder_as_told(self) -> None:
        held = self.access.holder(self.now)
        if held is None:
            assert self.lease is None and self.access.priority_under_control == 0
        else:
            assert self.lease and (held.client, held.priority) == (self.lease.client, self.lease.priority)
            assert held.lease_id == self.lease.lease == self.access.token.lease

    @invariant()
    def a_reference_lives_100_ms(self) -> None:
        self.guard.expired(self.now)
        alive = self.reference_at is not None and self.now - self.reference_at < 100_000_000
        assert self.guard.alive == alive


# As many runs as are promised, the same ones each time; RACKHAND_FUZZ_EXAMPLES draws others.
ASKED = os.environ.get("RACKHAND_FUZZ_EXAMPLES")
PriorityAccess.TestCase.settings = settings(
    max_examples=int(ASKED or 1000),
    stateful_step_count=40,
    deadline=None,
    derandomize=ASKED is None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large],
)
TestPriorityAccess = PriorityAccess.TestCase
