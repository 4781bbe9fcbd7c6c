"""Who may control the arm: the table of refusals."""

from __future__ import annotations

import pytest

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import FencingToken, RefusalDetail
from rackhand.services.controller.access import rules
from rackhand.services.controller.access.entries import Entry
from rackhand.services.controller.access.types import AccessConfig, Caller, Command, Stop

HELD = Entry("a", 10, 100, "softStop", 0)
TOKEN = FencingToken(epoch="e1", lease=3)


@pytest.mark.parametrize(
    ("client", "priority", "force", "detail"),
    [
        ("a", 10, False, None),
        ("a", 9, False, None),
        ("a", 11, False, RefusalDetail.NONE),
        ("b", 9, False, None),
        ("b", 10, False, RefusalDetail.HELD_BY_EQUAL),
        ("b", 11, False, RefusalDetail.NONE),
        ("b", 11, True, None),
        ("b", 3, True, RefusalDetail.PRIORITY_RESERVED),
        ("pendant", 3, False, None),
    ],
)
def test_a_smaller_number_preempts_and_an_equal_one_of_another_client_does_not(
    client: str, priority: int, force: bool, detail: RefusalDetail | None
) -> None:
    config = AccessConfig(reserved=((3, frozenset({"pendant"})),))
    refusal = rules.claim(config, HELD, client, priority, force)
    assert (refusal.detail if refusal else None) == detail
    assert refusal is None or (not refusal.ok and refusal.code == CrfCode.Forbidden)
    if priority != 3:
        assert rules.claim(config, None, client, priority) is None, "nobody holds it"


@pytest.mark.parametrize(
    ("client", "epoch", "lease", "current"),
    [
        ("a", None, None, True),
        ("b", None, None, True),
        ("a", "e1", 3, True),
        ("a", None, 3, True),
        ("a", "e1", None, True),
        ("a", "e1", 2, False),
        ("a", "e0", 3, False),
        ("b", "e1", 3, False),
    ],
)
def test_a_token_belongs_to_one_grant(client: str, epoch: str | None, lease: int | None, current: bool) -> None:
    command = Command(Caller(client), "setVelocity", 10, epoch=epoch, lease=lease)
    refusal = rules.outdated(AccessConfig(), HELD, TOKEN, command)
    assert (refusal is None) == current
    if refusal:
        assert (refusal.code, refusal.detail) == (CrfCode.PreconditionFailed, RefusalDetail.STALE_LEASE)
        strict = rules.outdated(AccessConfig(strict_crf=True), HELD, TOKEN, command)
        assert strict and strict.code == CrfCode.Forbidden, "CRF knows no 412"


def test_a_latched_stop_refuses_motion_of_everyone_else() -> None:
    move, setting = Command(Caller("a"), "appendPath", 10), Command(Caller("a"), "setParameters", 10, moves=False)
    assert rules.blocked(None, move) is None and rules.blocked("a", move) is None
    assert rules.blocked("b", setting) is None
    for latched, name in (("b", "b"), ("", "several clients")):
        refusal = rules.blocked(latched, move)
        assert refusal and refusal.text == f"stopped by {name}: send resumeControl first"


def test_only_strict_crf_refuses_a_stop() -> None:
    strict = AccessConfig(strict_crf=True)
    for priority, refused in ((None, True), (11, True), (10, False), (1, False)):
        stop = Stop(Caller("b"), "softStop", priority)
        assert rules.stop_refused(AccessConfig(), HELD, stop) is None
        assert (rules.stop_refused(strict, HELD, stop) is not None) == refused
        assert rules.stop_refused(strict, None, stop) is None
