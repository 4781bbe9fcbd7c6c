"""Priority access: who may move the arm (spec motion-controller §5 and the guarantees of §7.2).

A pure state machine: what happens goes in with a monotonic time, the answer and all that follows from it come out.

* One holder, and it has a name: identity is (priority, client). A smaller number pre-empts at once; an equal number of
  another client is refused. Any accepted command takes the lock, as in CRF.
* Every grant and every loss counts the lease up, so that a token of the past is recognisable (``FencingGuard``).
* A holder that falls silent loses control, and its motion ends as declared. What a former holder set in motion is
  stopped and cleared before another client's first command.
* Stops are taken from anyone. One from somebody else than the holder latches: nothing moves until the holder or a
  higher priority resumes, or the stopper itself moves the arm.
* A new ``Access`` is a restart: new epoch, no holder.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import ControlInfo, FencingToken, Holder, LossReason, RefusalDetail
from rackhand.services.controller.access.types import (
    SECOND,
    AccessConfig,
    AccessInput,
    AtRest,
    AuditEntry,
    Beat,
    Caller,
    Command,
    ContinueMotion,
    ControlEvent,
    Decision,
    Disconnected,
    Lock,
    OnLoss,
    Order,
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
"""Stands for more than one client where one is named; no client has an empty name."""

_NOT_CONFIGURED = Decision(False, CrfCode.BadRequest, text="Heartbeat has not been configured")


@dataclass(frozen=True)
class _Entry:
    """Somebody who asked for control: the holder, or one that waits for it."""

    client: str
    priority: int
    keep_alive_ns: int
    on_loss: OnLoss
    refreshed: int

    def fresh(self, now: int) -> bool:
        return now - self.refreshed <= self.keep_alive_ns


class Access:
    """See the module. ``epoch`` is new at every start of the process."""

    def __init__(self, epoch: str, config: AccessConfig = AccessConfig()) -> None:  # noqa: B008 - it is frozen
        self.config = config
        self.epoch = epoch
        self._now = 0
        self._lease = 0
        self._serial = 0
        self._stop_serial = 0
        self._stopping = False
        self._holder: _Entry | None = None
        self._waiting: dict[tuple[int, str], _Entry] = {}
        self._beats: dict[str, tuple[int, int]] = {}
        self._mover: str | None = None
        self._kept_for: str | None = None
        self._latched_by: str | None = None
        self._orders: list[Order] = []
        self._events: list[ControlEvent] = []
        self._audit: list[AuditEntry] = []

    # -- what others may see ------------------------------------------------------------------------------------------

    @property
    def token(self) -> FencingToken:
        """The token of now: of the holder, or of nobody when there is none. Older ones are void."""
        return FencingToken(epoch=self.epoch, lease=self._lease)

    @property
    def priority_under_control(self) -> int:
        """The holder's number; 0, nobody."""
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
        return Holder(client=held.client, priority=held.priority, lease_id=self._lease, lease_age=age)

    # -- the machine --------------------------------------------------------------------------------------------------

    def handle(self, happened: AccessInput, now: int) -> Outcome:
        """``now``: monotonic nanoseconds. What ran out before ``happened`` is dealt with first."""
        self._now = max(self._now, now)
        self._run_out()
        verdict = self._dispatch(happened)
        outcome = Outcome(verdict, tuple(self._orders), tuple(self._events), tuple(self._audit))
        self._orders, self._events, self._audit = [], [], []
        return outcome

    def _dispatch(self, happened: AccessInput) -> Decision:
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
                self._beats.pop(client, None)
                self._vanish(client, "disconnected")
            case AtRest(serial):
                if serial >= self._stop_serial:
                    self._stopping = False
                if serial >= self._serial:
                    self._mover = None
            case Tick():
                pass
        return Decision(True)

    def _lock(self, lock: Lock) -> Decision:
        caller = lock.caller
        force = lock.force and caller.role in self.config.force_roles
        refusal = self._claim(caller.client, lock.priority, force)
        entry = self._entry(caller.client, lock.priority)
        if lock.keep_alive_ns is not None:
            keep_alive = max(lock.keep_alive_ns, self.config.min_keep_alive_ns)
            entry = replace(entry, keep_alive_ns=min(keep_alive, self.config.keep_alive_ns))
        entry = replace(entry, on_loss=lock.on_loss or entry.on_loss)
        if refusal:
            if refusal.detail is not RefusalDetail.PRIORITY_RESERVED:
                self._wait(entry)
            return self._deny(caller, "lockControl", lock.priority, refusal)
        self._take(entry, caller, lock.takeover, force)
        return Decision(True, token=self.token, keep_alive_ns=entry.keep_alive_ns, after_rest=self._stopping)

    def _unlock(self, unlock: Unlock) -> Decision:
        client, held = unlock.caller.client, self._holder
        if held and (held.client, held.priority) == (client, unlock.priority):
            self._note("unlockControl", unlock.caller, unlock.priority)
            self._lose("released", self.config.on_release)
            self._promote()
            return Decision(True)
        if self._waiting.pop((unlock.priority, client), None):
            return Decision(True)
        return Decision(False, CrfCode.Forbidden, text=f"priority {unlock.priority} is not held by {client}")

    def _command(self, command: Command) -> Decision:
        """Refused without a trace in the state, or granted: then the lock is taken or refreshed."""
        caller = command.caller
        refusal = self.refusal(command)
        if refusal:
            return self._deny(caller, command.name, command.priority, refusal)
        entry = self._entry(caller.client, command.priority)
        self._take(entry, caller, command.takeover)
        if command.resumes or (command.moves and self._latched_by == caller.client):
            self._resume(command)
        if command.moves:
            self._begin(caller.client)
        if command.audited:
            self._note(command.name, caller, command.priority)
        return Decision(
            True, token=self.token, keep_alive_ns=entry.keep_alive_ns, after_rest=self._stopping, serial=self._serial
        )

    def _stop(self, stop: Stop) -> Decision:
        caller, held = stop.caller, self._holder
        if self.config.strict_crf and held and (stop.priority is None or held.priority < stop.priority):
            refusal = Decision(False, CrfCode.Forbidden, text=f"{held.client} holds priority {held.priority}")
            return self._deny(caller, stop.kind, stop.priority or 0, refusal)
        if held and held.client == caller.client:
            self._holder = replace(held, refreshed=self._now)
        elif not self.config.strict_crf:
            self._latched_by = caller.client if self._latched_by in (None, caller.client) else SEVERAL
        self._order_stop(stop.kind, clear=True, reason=f"{stop.kind} by {caller.client}")
        info = self._info(held, by=caller.client, by_priority=stop.priority, kind=stop.kind)
        self._events.append(ControlEvent("stopped", "", info))
        self._note(stop.kind, caller, stop.priority or 0)
        return Decision(True, serial=self._serial)

    def _heartbeat(self, beat: StartBeat | Beat | StopBeat) -> Decision:
        client = beat.caller.client
        if isinstance(beat, StartBeat):
            if client not in self._beats and len(self._beats) >= self.config.max_clients:
                return Decision(False, CrfCode.ServiceUnavailable, text=f"{len(self._beats)} heartbeats are watched")
            self._beats[client] = (beat.period_ns, self._now)
        elif client not in self._beats:
            return _NOT_CONFIGURED
        elif isinstance(beat, StopBeat):
            del self._beats[client]
        else:
            self._beats[client] = (self._beats[client][0], self._now)
        if self._holder and self._holder.client == client:
            self._holder = replace(self._holder, refreshed=self._now)
        return Decision(True)

    # -- who may ------------------------------------------------------------------------------------------------------

    def refusal(self, command: Command) -> Decision | None:
        """Why ``command`` would be refused as things stand; ``None`` if it would be granted. Changes nothing."""
        client = command.caller.client
        return self._outdated(command) or self._claim(client, command.priority) or self._blocked(command, client)

    def _claim(self, client: str, priority: int, force: bool = False) -> Decision | None:
        """Why ``client`` may not control at ``priority``; ``None`` if it may."""
        for number, clients in self.config.reserved:
            if number == priority and client not in clients:
                text = f"priority {priority} is reserved"
                return Decision(False, CrfCode.Forbidden, RefusalDetail.PRIORITY_RESERVED, text)
        held = self._holder
        if held is None or force or priority < held.priority:
            return None
        if priority == held.priority:
            if client == held.client:
                return None
            text = f"{held.client} holds the same priority {priority}"
            return Decision(False, CrfCode.Forbidden, RefusalDetail.HELD_BY_EQUAL, text)
        return Decision(False, CrfCode.Forbidden, text=f"{held.client} holds priority {held.priority}")

    def _outdated(self, command: Command) -> Decision | None:
        """A command that carries a token belongs to that grant and to no other."""
        held = self._holder
        if command.lease is None and command.epoch is None:
            return None
        mine = held is not None and held.client == command.caller.client
        if mine and command.lease in (None, self._lease) and command.epoch in (None, self.epoch):
            return None
        code = CrfCode.Forbidden if self.config.strict_crf else CrfCode.PreconditionFailed
        given = f"lease {command.lease} of epoch {command.epoch or 'unnamed'}"
        text = f"{given} is not {command.caller.client}'s; it is {self._lease} of {self.epoch} now"
        return Decision(False, code, RefusalDetail.STALE_LEASE, text)

    def _blocked(self, command: Command, client: str) -> Decision | None:
        if not command.moves or self._latched_by in (None, client):
            return None
        text = f"stopped by {self._latched_by or 'several clients'}: send resumeControl first"
        return Decision(False, CrfCode.Forbidden, RefusalDetail.STOP_LATCHED, text)

    def _entry(self, client: str, priority: int) -> _Entry:
        """The holder refreshed, if it is that; else a newcomer with what the configuration gives it."""
        held = self._holder
        if held and (held.client, held.priority) == (client, priority):
            return replace(held, refreshed=self._now)
        return _Entry(client, priority, self.config.keep_alive_ns, self.config.on_loss, self._now)

    # -- changes of holder --------------------------------------------------------------------------------------------

    def _take(self, entry: _Entry, caller: Caller, takeover: Takeover, force: bool = False) -> None:
        held = self._holder
        if held and (held.client, held.priority) == (entry.client, entry.priority):
            self._holder = entry
            return
        if held:
            reason: LossReason = "forced" if force else "preempted"
            self._lose(reason, "finishPath", by=entry)
            if not force:
                self._wait(held)
        self._grant(entry, takeover)
        action = ("force" if force else "preempt") if held else "grant"
        self._note(action, caller, entry.priority, f"from {held.client} at {held.priority}" if held else "")

    def _grant(self, entry: _Entry, takeover: Takeover) -> None:
        self._lease += 1
        self._holder = entry
        self._waiting.pop((entry.priority, entry.client), None)
        foreign = self._mover not in (None, entry.client) or self._kept_for not in (None, entry.client)
        if foreign and takeover == "continue":
            self._mover = entry.client if self._mover else None
            self._kept_for = entry.client if self._kept_for else None
        elif foreign:
            self._order_stop("softStop", clear=True, reason=f"control passes to {entry.client}")
        self._events.append(ControlEvent("controlGranted", entry.client, self._info(entry)))

    def _lose(self, reason: LossReason, effect: OnLoss, by: _Entry | None = None) -> None:
        held = self._holder
        assert held is not None
        info = self._info(held, by=by.client if by else None, by_priority=by.priority if by else None, reason=reason)
        self._events.append(ControlEvent("controlLost", held.client, info))
        self._holder = None
        # The number is spent: a command of the lost lease is older than the token of "nobody".
        self._lease += 1
        if effect == "softStop":
            self._order_stop("softStop", clear=True, reason=f"{held.client} lost control: {reason}")
        elif effect == "hold":
            self._order_stop("softStop", clear=False, reason=f"{held.client} lost control: {reason}")
            self._kept_for = held.client

    def _vanish(self, client: str, reason: LossReason) -> None:
        """A client is gone: its lock with it, its place in the queue, and what it left running."""
        self._waiting = {key: entry for key, entry in self._waiting.items() if entry.client != client}
        held = self._holder
        if held and held.client == client:
            self._note(reason, Caller(client), held.priority)
            self._lose(reason, held.on_loss)
            self._promote()
        elif self._mover == client:
            self._note(reason, Caller(client), 0, "stopped what it had left running")
            self._order_stop("softStop", clear=True, reason=f"{client} is gone: {reason}")

    def _run_out(self) -> None:
        held = self._holder
        if held and not held.fresh(self._now):
            self._note("expire", Caller(held.client), held.priority)
            self._lose("expired", held.on_loss)
            self._promote()
        for client, (period, last) in list(self._beats.items()):
            if self._now - last > period:
                del self._beats[client]
                info = self._info(self._holder, by=client, reason="heartbeat")
                self._events.append(ControlEvent("heartbeatLost", "", info))
                self._vanish(client, "heartbeat")

    def _wait(self, entry: _Entry) -> None:
        """CRF keeps a refused request: it is granted when those before it leave, as long as it is fresh."""
        key = (entry.priority, entry.client)
        if len(self._waiting) >= self.config.max_clients and key not in self._waiting:
            self._waiting = {key: old for key, old in self._waiting.items() if old.fresh(self._now)}
        if key in self._waiting or len(self._waiting) < self.config.max_clients:
            self._waiting[key] = entry

    def _promote(self) -> None:
        self._waiting = {key: entry for key, entry in self._waiting.items() if entry.fresh(self._now)}
        if self._waiting:
            entry = min(self._waiting.values(), key=lambda waiting: waiting.priority)
            self._grant(entry, "stop")
            self._note("promote", Caller(entry.client), entry.priority)

    # -- motion -------------------------------------------------------------------------------------------------------

    def _begin(self, client: str) -> None:
        if self._kept_for is not None:
            # A new command instead of a resume: what was kept is no longer wanted.
            self._order_stop("softStop", clear=True, reason=f"{client} commands anew")
        self._serial += 1
        self._mover = client

    def _resume(self, command: Command) -> None:
        client = command.caller.client
        if self._latched_by is not None:
            self._latched_by = None
            self._events.append(ControlEvent("resumed", "", self._info(self._holder, by=client)))
            self._note("resume", command.caller, command.priority)
        if command.resumes and self._kept_for == client:
            self._kept_for = None
            self._serial += 1
            self._mover = client
            self._orders.append(ContinueMotion(self._serial))

    def _order_stop(self, kind: StopKind, clear: bool, reason: str) -> None:
        self._serial += 1
        self._stop_serial = self._serial
        self._stopping = True
        self._mover = self._kept_for = None
        self._orders.append(StopMotion(self._serial, kind, clear, reason))

    # -- records ------------------------------------------------------------------------------------------------------

    def _info(
        self,
        entry: _Entry | None,
        by: str | None = None,
        by_priority: int | None = None,
        reason: str | None = None,
        kind: StopKind | None = None,
    ) -> ControlInfo:
        return ControlInfo(
            client=entry.client if entry else "",
            priority=entry.priority if entry else 0,
            lease_id=self._lease,
            epoch=self.epoch,
            by=by,
            by_priority=by_priority,
            reason=reason,
            kind=kind,
        )

    def _deny(self, caller: Caller, action: str, priority: int, refusal: Decision) -> Decision:
        self._note(action, caller, priority, refusal.text, refusal.code)
        return refusal

    def _note(self, action: str, caller: Caller, priority: int, text: str = "", code: CrfCode = CrfCode.OK) -> None:
        self._audit.append(
            AuditEntry(
                monotonic_ns=self._now,
                action=action,
                client=caller.client,
                user=caller.user,
                role=caller.role,
                priority=priority,
                epoch=self.epoch,
                lease_id=self._lease,
                request_id=caller.request_id,
                code=int(code),
                text=text,
            )
        )
