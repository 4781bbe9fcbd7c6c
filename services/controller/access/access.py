"""Priority access: who may move the arm (spec motion-controller §5 and the guarantees of §7.2).

A pure state machine: an input and a monotonic time go in, the decision and everything that follows from it come out.

* One holder: identity is (priority, client). A smaller number pre-empts at once; an equal number of
  another client is refused. Any accepted command takes the lock, as in CRF.
* Every grant and every loss counts the lease up, so that a token of the past is recognisable (``FencingGuard``).
* A holder whose keep-alive expires loses control, and its motion ends as declared, also where another client has
  waited for control. The motion of a former holder is stopped and cleared before another client's first command that
  moves the arm.
* Stops are accepted from any client. A stop by another client than the holder latches: nothing moves until the holder
  or a higher priority resumes, or the client that stopped moves the arm itself.
* A new ``Access`` is a restart: new epoch, no holder.
"""

from __future__ import annotations

from dataclasses import replace

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import FencingToken, Holder, LossReason, RefusalDetail
from rackhand.services.controller.access import rules
from rackhand.services.controller.access.entries import Entry, WaitingList
from rackhand.services.controller.access.heartbeats import Heartbeats
from rackhand.services.controller.access.record import OutcomeRecord
from rackhand.services.controller.access.types import (
    SECOND,
    AccessConfig,
    AccessInput,
    AtRest,
    Beat,
    Caller,
    Command,
    ContinueMotion,
    Decision,
    Disconnected,
    Lock,
    OnLoss,
    Outcome,
    StartBeat,
    Stop,
    StopBeat,
    StopKind,
    StopMotion,
    Takeover,
    Tick,
    Unlock,
)

SEVERAL = ""
"""Means more than one client where one is named; no client has an empty name."""

_NOT_CONFIGURED = Decision(False, CrfCode.BadRequest, text="Heartbeat has not been configured")


class Access:
    """See the module. ``epoch`` is new at every start of the process."""

    def __init__(self, epoch: str, config: AccessConfig = AccessConfig()) -> None:  # noqa: B008 - it is frozen
        self.config = config
        self._now = 0
        self._record = OutcomeRecord(epoch)
        self._holder: Entry | None = None
        self._waiting = WaitingList(config.max_clients)
        self._heartbeats = Heartbeats(config.max_clients)
        self._latched_by: str | None = None
        self._serial = 0
        self._stop_serial = 0
        self._stopping = False
        self._moved_by: str | None = None  # whose command the arm carries out
        self._kept_for: str | None = None  # whose queue a "hold" has kept

    # -- what others may see ------------------------------------------------------------------------------------------

    @property
    def epoch(self) -> str:
        return self._record.token.epoch

    @property
    def token(self) -> FencingToken:
        """The current token: of the holder, or a token of no client when there is none. Older ones are void."""
        return self._record.token

    @property
    def priority_under_control(self) -> int:
        """The holder's number; 0 if there is no holder."""
        return self._holder.priority if self._holder else 0

    @property
    def stopped_by(self) -> str | None:
        """The client whose stop is latched; empty, several."""
        return self._latched_by

    def holder(self, now: int) -> Holder | None:
        held = self._holder
        if held is None:
            return None
        age = max(now - held.refreshed, 0) / SECOND
        return Holder(client=held.client, priority=held.priority, lease_id=self.token.lease, lease_age=age)

    def refusal(self, command: Command) -> Decision | None:
        """Why ``command`` would be refused in the present state; ``None`` if it would be granted. Changes nothing."""
        return (
            rules.outdated(self.config, self._holder, self.token, command)
            or rules.claim(self.config, self._holder, command.caller.client, command.priority)
            or rules.blocked(self._latched_by, command)
        )

    # -- the machine --------------------------------------------------------------------------------------------------

    def handle(self, happened: AccessInput, now: int) -> Outcome:
        """``now``: monotonic nanoseconds. What has expired before ``happened`` is dealt with first."""
        self._now = self._record.now = max(self._now, now)
        self._expire()
        return self._record.take(self._decide(happened))

    def _decide(self, happened: AccessInput) -> Decision:
        match happened:
            case Lock():
                return self._lock(happened)
            case Unlock():
                return self._unlock(happened)
            case Command():
                return self._command(happened)
            case Stop():
                return self._stop(happened)
            case StartBeat() | Beat() | StopBeat():
                return self._heartbeat(happened)
            case Disconnected(client):
                self._heartbeats.stop(client)
                self._gone(client, "disconnected")
            case AtRest(serial):
                if serial >= self._stop_serial:
                    self._stopping = False
                if serial >= self._serial:
                    self._moved_by = None
            case Tick():
                pass
        return Decision(True)

    def _lock(self, lock: Lock) -> Decision:
        caller = lock.caller
        force = lock.force and caller.role in self.config.force_roles
        refusal = rules.claim(self.config, self._holder, caller.client, lock.priority, force)
        entry = self._entry(caller.client, lock.priority)
        if lock.keep_alive_ns is not None:
            keep_alive = max(lock.keep_alive_ns, self.config.min_keep_alive_ns)
            entry = replace(entry, keep_alive_ns=min(keep_alive, self.config.keep_alive_ns))
        entry = replace(entry, on_loss=lock.on_loss or entry.on_loss)
        if refusal:
            if refusal.detail is not RefusalDetail.PRIORITY_RESERVED:
                self._waiting.add(entry, self._now)
            return self._record.refused(caller, "lockControl", lock.priority, refusal)
        self._take(entry, caller, lock.takeover, force)
        return Decision(True, token=self.token, keep_alive_ns=entry.keep_alive_ns, after_rest=self._stopping)

    def _unlock(self, unlock: Unlock) -> Decision:
        client, held = unlock.caller.client, self._holder
        if held and held.is_of(client, unlock.priority):
            self._record.audit("unlockControl", unlock.caller, unlock.priority)
            self._lose("released", self.config.on_release)
            self._promote()
            return Decision(True)
        if self._waiting.remove(client, unlock.priority):
            return Decision(True)
        return Decision(False, CrfCode.Forbidden, text=f"priority {unlock.priority} is not held by {client}")

    def _command(self, command: Command) -> Decision:
        """Refused without a trace in the state, or granted: then the lock is taken or refreshed."""
        caller = command.caller
        refusal = self.refusal(command)
        if refusal:
            return self._record.refused(caller, command.name, command.priority, refusal)
        entry = self._entry(caller.client, command.priority)
        self._take(entry, caller, command.takeover)
        if command.resumes or (command.moves and self._latched_by == caller.client):
            self._resume(command)
        if command.moves:
            self._begin_motion(caller.client, command.takeover)
        if command.audited:
            self._record.audit(command.name, caller, command.priority)
        return Decision(
            True, token=self.token, keep_alive_ns=entry.keep_alive_ns, after_rest=self._stopping, serial=self._serial
        )

    def _stop(self, stop: Stop) -> Decision:
        caller, held = stop.caller, self._holder
        if refusal := rules.stop_refused(self.config, held, stop):
            return self._record.refused(caller, stop.kind, stop.priority or 0, refusal)
        if held and held.client == caller.client:
            self._holder = replace(held, refreshed=self._now)
        elif not self.config.strict_crf:
            self._latched_by = caller.client if self._latched_by in (None, caller.client) else SEVERAL
        self._stop_motion(stop.kind, clear=True, reason=f"{stop.kind} by {caller.client}")
        self._record.event("stopped", "", held, by=caller.client, by_priority=stop.priority, kind=stop.kind)
        self._record.audit(stop.kind, caller, stop.priority or 0)
        return Decision(True, serial=self._serial)

    def _heartbeat(self, beat: StartBeat | Beat | StopBeat) -> Decision:
        client, beats = beat.caller.client, self._heartbeats
        if isinstance(beat, StartBeat):
            if not beats.start(client, beat.period_ns, self._now):
                return Decision(False, CrfCode.ServiceUnavailable, text=f"{len(beats)} heartbeats are watched")
        elif client not in beats:
            return _NOT_CONFIGURED
        elif isinstance(beat, StopBeat):
            beats.stop(client)
        else:
            beats.beat(client, self._now)
        if self._holder and self._holder.client == client:
            self._holder = replace(self._holder, refreshed=self._now)
        return Decision(True)

    def _entry(self, client: str, priority: int) -> Entry:
        """The holder refreshed, if it is that; else a newcomer with what the configuration gives it."""
        held = self._holder
        if held and held.is_of(client, priority):
            return replace(held, refreshed=self._now)
        return Entry(client, priority, self.config.keep_alive_ns, self.config.on_loss, self._now)

    # -- changes of holder --------------------------------------------------------------------------------------------

    def _take(self, entry: Entry, caller: Caller, takeover: Takeover, force: bool = False) -> None:
        held = self._holder
        if held and held.is_of(entry.client, entry.priority):
            self._holder = entry
            if takeover == "continue":
                self._take_over(entry.client, takeover)
            return
        if held:
            self._lose("forced" if force else "preempted", "finishPath", by=entry)
            if not force:
                self._waiting.add(held, self._now)
        self._grant(entry, takeover)
        action = ("force" if force else "preempt") if held else "grant"
        self._record.audit(action, caller, entry.priority, f"from {held.client} at {held.priority}" if held else "")

    def _grant(self, entry: Entry, takeover: Takeover | None) -> None:
        """``takeover`` ``None``: a motion of another client goes on until ``entry``'s client moves the arm."""
        self._record.next_lease()
        self._holder = entry
        self._waiting.remove(entry.client, entry.priority)
        if takeover is not None or self._kept_for not in (None, entry.client):
            self._take_over(entry.client, takeover or "stop")
        self._record.event("controlGranted", entry.client, entry)

    def _take_over(self, client: str, takeover: Takeover) -> None:
        """Stops the motion and the queue of another client than ``client``, or makes them its own."""
        foreign = self._moved_by not in (None, client) or self._kept_for not in (None, client)
        if foreign and takeover == "continue":
            self._moved_by = client if self._moved_by else None
            self._kept_for = client if self._kept_for else None
        elif foreign:
            self._stop_motion("softStop", clear=True, reason=f"control goes to {client}")

    def _lose(self, reason: LossReason, effect: OnLoss, by: Entry | None = None) -> None:
        held = self._holder
        assert held is not None
        by_client, by_priority = (by.client, by.priority) if by else (None, None)
        self._record.event("controlLost", held.client, held, by=by_client, by_priority=by_priority, reason=reason)
        self._holder = None
        # A command of the lost lease must be older than the token without holder.
        self._record.next_lease()
        if self._moved_by not in (None, held.client):
            return  # what a former holder left running when it released control is not this one's
        if effect == "softStop":
            self._stop_motion("softStop", clear=True, reason=f"{held.client} lost control: {reason}")
        elif effect == "hold":
            self._stop_motion("softStop", clear=False, reason=f"{held.client} lost control: {reason}")
            self._kept_for = held.client

    def _gone(self, client: str, reason: LossReason) -> None:
        """Ends the lock of a client that is gone, its place in the waiting list, and the motion it left running."""
        self._waiting.remove_client(client)
        held = self._holder
        if held and held.client == client:
            self._record.audit(reason, Caller(client), held.priority)
            self._lose(reason, held.on_loss)
            self._promote()
        elif self._moved_by == client:
            self._record.audit(reason, Caller(client), 0, "motion left by the client was stopped")
            self._stop_motion("softStop", clear=True, reason=f"{client} has disconnected: {reason}")

    def _expire(self) -> None:
        held = self._holder
        if held and not held.fresh(self._now):
            self._record.audit("expire", Caller(held.client), held.priority)
            self._lose("expired", held.on_loss)
            self._promote()
        for client in self._heartbeats.expired(self._now):
            self._record.event("heartbeatLost", "", self._holder, by=client, reason="heartbeat")
            self._gone(client, "heartbeat")

    def _promote(self) -> None:
        """Grants control to the first that waits."""
        entry = self._waiting.first(self._now)
        if entry is not None:
            self._grant(entry, None)
            self._record.audit("promote", Caller(entry.client), entry.priority)

    # -- motion -------------------------------------------------------------------------------------------------------

    def _begin_motion(self, client: str, takeover: Takeover) -> None:
        self._take_over(client, takeover)
        if self._kept_for is not None:
            # A new command instead of a resume: the kept queue is no longer wanted.
            self._stop_motion("softStop", clear=True, reason=f"{client} sent a new command")
        self._serial += 1
        self._moved_by = client

    def _resume(self, command: Command) -> None:
        client = command.caller.client
        if self._latched_by is not None:
            self._latched_by = None
            self._record.event("resumed", "", self._holder, by=client)
            self._record.audit("resume", command.caller, command.priority)
        if command.resumes and self._kept_for == client:
            self._kept_for = None
            self._serial += 1
            self._moved_by = client
            self._record.motion(ContinueMotion(self._serial))

    def _stop_motion(self, kind: StopKind, clear: bool, reason: str) -> None:
        self._serial += 1
        self._stop_serial = self._serial
        self._stopping = True
        self._moved_by = self._kept_for = None
        self._record.motion(StopMotion(self._serial, kind, clear, reason))
