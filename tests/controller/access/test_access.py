"""Priority access: each guarantee by an example of its own. Times in seconds for reading."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import FencingToken, RefusalDetail
from rackhand.services.controller.access.access import Access
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
    StopBeat,
    StopMotion,
    Tick,
    Unlock,
)


class Desk:
    """Access with a clock in seconds and clients by name."""

    def __init__(self, **config: Any) -> None:
        self.access = Access("e1", AccessConfig(**config))
        self.now = 0.0

    def __call__(self, happened: AccessInput) -> Outcome:
        return self.access.handle(happened, int(self.now * SECOND))

    def lock(self, client: str, priority: int, **fields: Any) -> Outcome:
        return self(Lock(Caller(client, role=fields.pop("role", "")), priority, **fields))

    def unlock(self, client: str, priority: int) -> Outcome:
        return self(Unlock(Caller(client), priority))

    def move(self, client: str, priority: int, **fields: Any) -> Outcome:
        return self(Command(Caller(client), "appendPath", priority, **fields))

    def stop(self, client: str, priority: int | None = None) -> Outcome:
        return self(Stop(Caller(client), "softStop", priority))

    def resume(self, client: str, priority: int) -> Outcome:
        return self(Command(Caller(client), "resumeControl", priority, moves=False, resumes=True))

    def wait(self, seconds: float) -> Outcome:
        self.now += seconds
        return self(Tick())


def stops(outcome: Outcome) -> list[tuple[str, bool]]:
    return [(effect.kind, effect.clear) for effect in outcome.motion if isinstance(effect, StopMotion)]


def told(outcome: Outcome) -> list[tuple[str, str, str | None]]:
    return [(event.name, event.to, event.info.reason) for event in outcome.events]


def test_the_sequence_of_priorities_that_crf_asserts() -> None:
    desk = Desk()
    assert desk.lock("a", 1).decision.ok and desk.access.priority_under_control == 1
    desk.wait(10.1)
    assert desk.access.priority_under_control == 0
    assert desk.lock("a", 100).decision.ok and desk.access.priority_under_control == 100
    assert not desk.lock("a", 200).decision.ok and desk.access.priority_under_control == 100
    assert desk.lock("a", 1).decision.ok and desk.access.priority_under_control == 1


def test_an_equal_number_of_another_client_is_refused_and_says_so() -> None:
    desk = Desk()
    desk.lock("a", 10)
    for decision in (desk.lock("b", 10).decision, desk.move("b", 10).decision):
        assert (decision.ok, decision.code, decision.detail) == (False, CrfCode.Forbidden, RefusalDetail.HELD_BY_EQUAL)
        assert decision.text == "a holds the same priority 10"
    assert desk.access.holder(0).client == "a"  # type: ignore[union-attr]
    assert not desk.unlock("c", 10).decision.ok
    assert desk.access.priority_under_control == 10


def test_a_command_takes_the_lock_and_a_refused_one_leaves_no_trace() -> None:
    desk = Desk()
    assert desk.move("a", 20).decision.ok
    assert desk.access.priority_under_control == 20
    refused = desk.move("b", 30)
    assert refused.decision.code == CrfCode.Forbidden and refused.decision.detail == 0
    assert not refused.motion and not refused.events
    desk.unlock("a", 20)
    assert desk.access.priority_under_control == 0


def test_pre_emption_is_announced_and_stops_and_clears_before_the_newcomer_moves() -> None:
    desk = Desk()
    old = desk.move("a", 20).decision.token
    taken = desk.move("b", 10)
    assert stops(taken) == [("softStop", True)]
    assert told(taken) == [("controlLost", "a", "preempted"), ("controlGranted", "b", None)]
    lost = taken.events[0].info
    assert (lost.client, lost.by, lost.by_priority) == ("a", "b", 10)
    assert taken.decision.after_rest
    assert old and taken.decision.token and taken.decision.token.lease > old.lease
    assert desk.move("b", 10).decision.after_rest
    stop = taken.motion[0]
    assert isinstance(stop, StopMotion)
    desk(AtRest(stop.serial - 1))
    assert desk.move("b", 10).decision.after_rest, "an earlier rest is not this one"
    desk(AtRest(stop.serial))
    assert not desk.move("b", 10).decision.after_rest


def test_taking_over_explicitly_goes_on_with_what_runs() -> None:
    desk = Desk()
    desk.move("a", 20)
    taken = desk.move("b", 10, takeover="continue")
    assert taken.decision.ok and not taken.motion and not taken.decision.after_rest
    assert stops(desk.move("c", 5)) == [("softStop", True)], "it is b's now, and foreign to c"


def test_lock_command_unlock_around_every_call_does_not_stop_the_arm() -> None:
    desk = Desk()
    for _ in range(3):
        outcomes = [desk.lock("a", 60), desk.move("a", 60), desk.unlock("a", 60)]
        assert all(o.decision.ok and not o.motion for o in outcomes)
    assert stops(desk.lock("b", 60)) == [("softStop", True)], "what a left running is not b's to append to"


def test_rest_of_the_past_does_not_hide_a_path_admitted_since() -> None:
    desk = Desk()
    first = desk.move("a", 60).decision.serial
    desk.move("a", 60)
    desk(AtRest(first))
    desk.unlock("a", 60)
    assert stops(desk.lock("b", 60)) == [("softStop", True)]


def test_at_rest_a_change_of_holder_needs_no_stop() -> None:
    desk = Desk()
    serial = desk.move("a", 60).decision.serial
    desk(AtRest(serial))
    desk.unlock("a", 60)
    assert not desk.move("b", 60).motion


def test_expiry_stops_and_is_reported() -> None:
    desk = Desk()
    desk.move("a", 20)
    assert not desk.wait(10.0).motion
    expired = desk.wait(0.001)
    assert stops(expired) == [("softStop", True)]
    assert told(expired) == [("controlLost", "a", "expired")]
    assert [entry.action for entry in expired.audit] == ["expire"]
    assert desk.access.priority_under_control == 0


@pytest.mark.parametrize("refresh", ["move", "lock", "beat", "stop"])
def test_the_lock_is_kept_alive_by(refresh: str) -> None:
    desk = Desk()
    desk.lock("a", 20)
    desk(StartBeat(Caller("a"), 100 * SECOND))
    desk.now += 9
    refreshing = {
        "move": lambda: desk.move("a", 20),
        "lock": lambda: desk.lock("a", 20),
        "beat": lambda: desk(Beat(Caller("a"))),
        "stop": lambda: desk.stop("a"),
    }
    refreshing[refresh]()
    desk.wait(9)
    assert desk.access.priority_under_control == 20


def test_a_refused_command_does_not_keep_the_lock_alive() -> None:
    desk = Desk()
    desk.lock("a", 20)
    desk.stop("b")
    desk.now += 9
    assert not desk.move("a", 20).decision.ok
    desk.wait(2)
    assert desk.access.priority_under_control == 0


def test_keep_alive_is_negotiable_downwards() -> None:
    desk = Desk()
    assert desk.lock("a", 20, keep_alive_ns=60 * SECOND).decision.keep_alive_ns == 10 * SECOND
    assert desk.lock("a", 20, keep_alive_ns=SECOND // 2).decision.keep_alive_ns == SECOND // 2
    assert desk.move("a", 20).decision.keep_alive_ns == SECOND // 2, "a command keeps what was negotiated"
    desk.wait(0.51)
    assert desk.access.priority_under_control == 0


def test_declared_effects_of_a_loss() -> None:
    finish = Desk()
    finish.lock("a", 20, on_loss="finishPath")
    finish.move("a", 20)
    assert not finish.wait(11).motion
    hold = Desk()
    hold.lock("a", 20, on_loss="hold")
    hold.move("a", 20)
    assert stops(hold.wait(11)) == [("softStop", False)]
    resumed = hold.resume("a", 20)
    assert [type(effect) for effect in resumed.motion] == [ContinueMotion]


@pytest.mark.parametrize("client", ["a", "b"])
def test_what_was_kept_is_dropped_by_a_new_command(client: str) -> None:
    desk = Desk()
    desk.lock("a", 20, on_loss="hold")
    desk.move("a", 20)
    desk.wait(11)
    assert stops(desk.move(client, 20)) == [("softStop", True)]
    assert not desk.resume(client, 20).motion, "there is nothing left to go on with"


def test_a_waiting_client_is_granted_when_the_others_leave() -> None:
    desk = Desk()
    desk.move("a", 10)
    desk.lock("b", 30)
    desk.lock("c", 20)
    left = desk.unlock("a", 10)
    assert told(left) == [("controlLost", "a", "released"), ("controlGranted", "c", None)]
    assert stops(left) == [], "what a released lock has set in motion is finished"
    assert desk.access.priority_under_control == 20
    desk.now += 5
    desk.lock("b", 30)
    desk.wait(6)
    assert desk.access.priority_under_control == 30, "c asked 11 s ago, b again 6 s ago"


def waits_while_another_moves(**lock: Any) -> Desk:
    """b waits for control while a moves the arm."""
    desk = Desk()
    desk.lock("a", 5, **lock)
    desk.move("a", 5)
    desk.lock("b", 20)
    return desk


def test_a_released_motion_ends_with_the_first_motion_of_who_has_waited() -> None:
    desk = waits_while_another_moves()
    assert not desk.unlock("a", 5).motion
    assert not desk.lock("b", 20).motion, "a client that waits asks for control again and again"
    assert not desk(Command(Caller("b"), "setGripper", 20, moves=False)).motion
    assert stops(desk.move("b", 20)) == [("softStop", True)]
    assert not desk.move("b", 20).motion, "its own motion goes on"


@pytest.mark.parametrize("by", ["lock", "move"])
def test_a_released_motion_may_be_taken_over_by_who_has_waited(by: str) -> None:
    desk = waits_while_another_moves()
    desk.unlock("a", 5)
    assert not getattr(desk, by)("b", 20, takeover="continue").motion
    assert not desk.move("b", 20).motion
    assert not desk(Disconnected("a")).motion, "it is b's now"


def test_a_path_that_may_be_finished_is_finished_whoever_waits() -> None:
    desk = waits_while_another_moves(on_loss="finishPath", keep_alive_ns=2 * SECOND)
    lost = desk.wait(3)
    assert told(lost) == [("controlLost", "a", "expired"), ("controlGranted", "b", None)]
    assert not lost.motion
    assert not desk.wait(8).motion, "b has moved nothing, so its lock expires without a stop"
    assert desk.access.priority_under_control == 0


@pytest.mark.parametrize("on_loss", ["softStop", "hold"])
def test_other_losses_stop_the_motion_whoever_waits(on_loss: Any) -> None:
    desk = waits_while_another_moves(on_loss=on_loss, keep_alive_ns=2 * SECOND)
    assert ("softStop", True) in stops(desk.wait(3)), "what is kept is dropped when another is granted control"


def test_a_vanished_client_stops_what_it_left_running_whoever_holds_control() -> None:
    desk = waits_while_another_moves()
    desk.unlock("a", 5)
    assert stops(desk(Disconnected("a"))) == [("softStop", True)]


def test_a_vanished_holder_stops_at_once_and_its_places_are_given_up() -> None:
    desk = Desk()
    desk.lock("b", 5)
    desk.lock("a", 10)
    desk.move("b", 5)
    assert told(desk(Disconnected("a"))) == []
    gone = desk(Disconnected("b"))
    assert stops(gone) == [("softStop", True)]
    assert told(gone) == [("controlLost", "b", "disconnected")]
    assert desk.access.priority_under_control == 0


def test_a_vanished_client_does_not_leave_the_arm_running() -> None:
    desk = Desk()
    desk.move("a", 10)
    desk.unlock("a", 10)
    assert stops(desk(Disconnected("a"))) == [("softStop", True)]
    assert not desk(Disconnected("a")).motion


def test_a_missed_heartbeat_acts_once() -> None:
    desk = Desk()
    desk.move("a", 10)
    desk(StartBeat(Caller("a"), SECOND))
    desk.wait(0.9)
    desk(Beat(Caller("a")))
    assert not desk.wait(0.9).motion
    missed = desk.wait(0.2)
    assert told(missed) == [("heartbeatLost", "", "heartbeat"), ("controlLost", "a", "heartbeat")]
    assert stops(missed) == [("softStop", True)]
    assert not desk.wait(5).events
    assert desk(Beat(Caller("a"))).decision.text == "Heartbeat has not been configured"
    assert not desk(StopBeat(Caller("a"))).decision.ok


def test_anyone_may_stop_and_the_stop_latches() -> None:
    desk = Desk()
    desk.move("a", 10)
    stopped = desk.stop("b", 90)
    assert stopped.decision.ok and stops(stopped) == [("softStop", True)]
    assert desk.access.priority_under_control == 10, "a stop takes no lock"
    refused = desk.move("a", 10).decision
    assert (refused.code, refused.detail) == (CrfCode.Forbidden, RefusalDetail.STOP_LATCHED)
    assert "resumeControl" in refused.text
    assert desk.lock("a", 10).decision.ok, "locking moves nothing, and resumes nothing"
    assert not desk.move("a", 10).decision.ok
    assert not desk.resume("c", 20).decision.ok
    assert told(desk.resume("a", 10))[-1][0] == "resumed"
    assert desk.move("a", 10).decision.ok


def test_a_higher_priority_resumes_and_the_stopper_itself_may_move() -> None:
    desk = Desk()
    desk.move("a", 10)
    desk.stop("b")
    assert desk.resume("boss", 1).decision.ok and desk.access.stopped_by is None
    desk.stop("b")
    assert desk.access.stopped_by == "b"
    desk.unlock("boss", 1)
    desk.unlock("a", 10)
    assert desk.move("b", 10).decision.ok and desk.access.stopped_by is None


def test_stops_of_several_are_nobodys_to_move_away() -> None:
    desk = Desk()
    desk.stop("b")
    desk.stop("c")
    assert not desk.move("b", 10).decision.ok and not desk.move("c", 10).decision.ok
    assert desk.resume("b", 10).decision.ok and desk.move("b", 10).decision.ok


def test_the_holders_own_stop_does_not_latch() -> None:
    desk = Desk()
    desk.move("a", 10)
    assert stops(desk.stop("a", 10)) == [("softStop", True)]
    again = desk.move("a", 10).decision
    assert again.ok and again.after_rest


def test_strict_crf_refuses_the_stop_of_a_lower_priority_and_latches_nothing() -> None:
    desk = Desk(strict_crf=True)
    desk.move("a", 10)
    refused = desk.stop("b", 20)
    assert refused.decision.code == CrfCode.Forbidden and not refused.motion
    assert desk.stop("b", 5).decision.ok
    assert desk.move("a", 10).decision.ok


@pytest.mark.parametrize(("strict", "code"), [(False, CrfCode.PreconditionFailed), (True, CrfCode.Forbidden)])
def test_a_command_of_a_lost_lease_is_refused(strict: bool, code: CrfCode) -> None:
    desk = Desk(strict_crf=strict)
    old = desk.lock("a", 10).decision.token
    assert old and desk.move("a", 10, lease=old.lease, epoch=old.epoch).decision.ok
    desk.unlock("a", 10)
    for lease in (old.lease, old.lease + 1, old.lease + 99):
        assert desk.move("a", 10, lease=lease).decision.code == code
    new = desk.lock("a", 10).decision.token
    assert new and new.lease > old.lease
    assert desk.move("a", 10, lease=old.lease).decision.code == code
    assert desk.move("a", 10, lease=new.lease, epoch="e0").decision.code == code
    assert desk.move("b", 5, lease=new.lease).decision.code == code, "somebody else's token"
    assert desk.move("a", 10, lease=new.lease).decision.ok


def test_reserved_priorities_and_taking_by_force() -> None:
    desk = Desk(reserved=((1, frozenset({"panel"})),), force_roles=frozenset({"supervisor"}))
    assert desk.lock("a", 1).decision.detail is RefusalDetail.PRIORITY_RESERVED
    assert desk.lock("panel", 1).decision.ok
    assert not desk.lock("b", 50, force=True, role="visitor").decision.ok
    forced = desk.lock("b", 50, force=True, role="supervisor")
    assert told(forced)[0] == ("controlLost", "panel", "forced")
    assert [entry.action for entry in forced.audit] == ["force"]
    desk.unlock("b", 50)
    assert desk.access.priority_under_control == 0


def test_a_restart_knows_nobody_and_old_tokens_are_void() -> None:
    desk = Desk()
    token = desk.lock("a", 10).decision.token
    assert token
    desk.access = Access("e2")
    assert desk.access.holder(0) is None and desk.access.priority_under_control == 0
    assert not desk.move("a", 10, lease=token.lease, epoch=token.epoch).decision.ok
    assert desk.access.token == FencingToken(epoch="e2", lease=0)


def test_time_that_goes_back_is_no_time() -> None:
    desk = Desk()
    desk.now = 100
    desk.lock("a", 10)
    desk.now = 5
    assert desk.move("a", 10).decision.ok
    desk.now = 110.1
    desk(Tick())
    assert desk.access.priority_under_control == 0


def test_a_crowd_of_strangers_fills_no_memory() -> None:
    desk = Desk(max_clients=8)
    desk.lock("a", 1)
    for i in range(50):
        desk.lock(f"stranger{i}", 10)
        desk(StartBeat(Caller(f"stranger{i}"), 100 * SECOND))
    refused = desk(StartBeat(Caller("b"), SECOND)).decision
    assert (refused.code, refused.text) == (CrfCode.ServiceUnavailable, "8 heartbeats are watched")
    desk.unlock("a", 1)
    promoted = []
    while (holder := desk.access.holder(0)) is not None:
        promoted.append(holder.client)
        desk.unlock(holder.client, 10)
    assert promoted == [f"stranger{i}" for i in range(8)]


def test_the_audit_names_who_did_what() -> None:
    desk = Desk()
    caller = Caller("a", "ann", "operator", "7")
    granted = desk(Command(caller, "setParameters", 10, moves=False, audited=True))
    assert [entry.action for entry in granted.audit] == ["grant", "setParameters"]
    entry = granted.audit[-1]
    assert (entry.client, entry.user, entry.role, entry.request_id, entry.priority) == ("a", "ann", "operator", "7", 10)
    assert (entry.epoch, entry.lease_id, entry.code) == ("e1", 1, 200)
    assert [e.action for e in desk.lock("b", 5).audit] == ["preempt"]
    assert [e.code for e in desk.move("a", 10).audit] == [403]
    assert [e.action for e in desk.stop("c").audit] == ["softStop"]
    assert [e.action for e in desk.unlock("b", 5).audit] == ["unlockControl", "promote"]


def test_the_configuration_refuses_nonsense() -> None:
    with pytest.raises(ValueError, match="keep-alive of 0 ns"):
        replace(AccessConfig(), keep_alive_ns=0)
