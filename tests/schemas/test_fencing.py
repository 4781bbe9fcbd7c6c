"""Commands of replaced leases and epochs, and late ones, do not reach the joints."""

from __future__ import annotations

from rackhand.schemas.fencing import FencingGuard
from rackhand.schemas.motion import FencingToken


def token(lease: int, epoch: str = "e1") -> FencingToken:
    return FencingToken(epoch=epoch, lease=lease)


def test_older_leases_and_older_stamps_do_not_pass() -> None:
    guard = FencingGuard()
    assert guard.admit(token(3), 100)
    assert guard.admit(token(3), 100), "the same instant may be answered again"
    assert not guard.admit(token(3), 99)
    assert guard.admit(token(5), 50), "stamps start anew with a lease"
    assert not guard.admit(token(3), 200) and not guard.admit(token(4), 200)
    assert guard.newest == token(5)


def test_a_new_lease_fences_out_the_old_one_before_its_first_command() -> None:
    guard = FencingGuard()
    guard.admit(token(3), 100)
    assert guard.raise_to(token(4))
    assert not guard.admit(token(3), 101)


def test_a_replaced_epoch_is_never_admitted_again() -> None:
    guard = FencingGuard()
    guard.admit(token(9, "e1"), 100)
    assert guard.admit(token(0, "e2"), 0)
    assert not guard.admit(token(99, "e1"), 200)
    assert guard.newest == token(0, "e2")


def test_a_refused_command_changes_nothing() -> None:
    guard = FencingGuard()
    assert guard.admit(token(3), 100)
    assert not guard.admit(token(2), 500)
    assert guard.newest == token(3)
    assert guard.admit(token(3), 100), "the stamp of the refused one does not count"
