"""Who may control the arm: pure rules. Each returns the refusal, or ``None`` if there is no objection."""

from __future__ import annotations

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import FencingToken, RefusalDetail
from rackhand.services.controller.access.entries import Entry
from rackhand.services.controller.access.types import AccessConfig, Command, Decision, Stop


def claim(config: AccessConfig, held: Entry | None, client: str, priority: int, force: bool = False) -> Decision | None:
    """Whether ``client`` may take control at ``priority`` from ``held``: a smaller number pre-empts, an equal number of
    another client is refused (spec motion-controller §5, §7.2)."""
    for number, clients in config.reserved:
        if number == priority and client not in clients:
            text = f"priority {priority} is reserved"
            return Decision(False, CrfCode.Forbidden, RefusalDetail.PRIORITY_RESERVED, text)
    if held is None or force or priority < held.priority or held.is_of(client, priority):
        return None
    if priority == held.priority:
        text = f"{held.client} holds the same priority {priority}"
        return Decision(False, CrfCode.Forbidden, RefusalDetail.HELD_BY_EQUAL, text)
    return Decision(False, CrfCode.Forbidden, text=f"{held.client} holds priority {held.priority}")


def outdated(config: AccessConfig, held: Entry | None, token: FencingToken, command: Command) -> Decision | None:
    """A command that carries a lease or an epoch belongs to that grant and to no other. ``token``: the current one."""
    if command.lease is None and command.epoch is None:
        return None
    client = command.caller.client
    mine = held is not None and held.client == client
    if mine and command.lease in (None, token.lease) and command.epoch in (None, token.epoch):
        return None
    code = CrfCode.Forbidden if config.strict_crf else CrfCode.PreconditionFailed
    given = f"lease {command.lease} of epoch {command.epoch or 'unnamed'}"
    text = f"{given} is not {client}'s; it is {token.lease} of {token.epoch} now"
    return Decision(False, code, RefusalDetail.STALE_LEASE, text)


def blocked(latched_by: str | None, command: Command) -> Decision | None:
    """A latched stop refuses motion of everyone but the client that stopped. ``latched_by`` empty: several clients."""
    if not command.moves or latched_by in (None, command.caller.client):
        return None
    text = f"stopped by {latched_by or 'several clients'}: send resumeControl first"
    return Decision(False, CrfCode.Forbidden, RefusalDetail.STOP_LATCHED, text)


def stop_refused(config: AccessConfig, held: Entry | None, stop: Stop) -> Decision | None:
    """Stops are taken from anyone, but under ``strict_crf`` they need the priority of a command."""
    if config.strict_crf and held and (stop.priority is None or held.priority < stop.priority):
        return Decision(False, CrfCode.Forbidden, text=f"{held.client} holds priority {held.priority}")
    return None
