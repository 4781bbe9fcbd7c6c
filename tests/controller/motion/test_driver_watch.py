"""A driver that does not follow this controller is noticed, by the watch and by the controller."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import ArmCommand, ArmState, FencingToken, Following
from rackhand.services.controller.motion.driver_watch import CommandDelay, DriverWatch
from tests.controller.cell import PERIOD_NS, UR5E, PerfectArm

STILL = (0.0,) * 6
OTHER = Following(token=FencingToken(epoch="another", lease=1), answers=0)


def state(stamp: int, follows: Following | None) -> ArmState:
    return ArmState(stamp=stamp, q=STILL, dq=STILL, efforts=STILL, wrench=STILL, follows=follows)


def own(stamp: int, age: int = PERIOD_NS) -> Following:
    return Following(token=FencingToken(epoch="e1", lease=3), answers=max(stamp - age, 0))


@pytest.mark.parametrize(
    ("follows", "said"),
    [
        (lambda _: OTHER, "epoch another"),
        (lambda _: Following(), "no command"),
        (lambda stamp: own(stamp, age=400_000_000), "400 ms old"),
        (own, ""),
        (lambda _: None, ""),
    ],
    ids=["another controller", "nothing", "an old command", "this one", "not reported"],
)
def test_what_a_driver_follows(follows: Any, said: str) -> None:
    watch = DriverWatch(PERIOD_NS)
    faults = [watch.fault(state(t, follows(t)), "e1") for t in range(10**9, 2 * 10**9, PERIOD_NS)]
    assert not any(faults[:10]), "a command needs its way"
    assert said in faults[-1] and bool(faults[-1]) == bool(said)


def test_a_command_that_is_lost_once_is_no_fault() -> None:
    watch = DriverWatch(PERIOD_NS)
    for t in range(0, 10**9, PERIOD_NS):
        lost = t // 40_000_000 % 3 == 0
        assert not watch.fault(state(t, Following() if lost else own(t)), "e1")


def test_a_controller_that_was_late_itself_gives_the_driver_the_time_it_did_not_have() -> None:
    """It stalls twice: each time the driver follows the last command before that, which is old by then."""
    watch = DriverWatch(PERIOD_NS)
    stalled = [(10**9, PERIOD_NS), (1_300_000_000, 300_000_000), (1_600_000_000, 300_000_000)]
    faults = [watch.fault(state(t, own(t, age)), "e1") for t, age in [*stalled, (1_604_000_000, PERIOD_NS)]]
    assert not any(faults)


class Obedient(PerfectArm):
    """Reports what it follows: the newest command, or what ``stray`` says."""

    stray: Following | None = None

    def tick(self) -> Any:
        last = self.command
        follows = self.stray or (Following() if last is None else Following(token=last.token, answers=last.answers))
        self.follows = follows
        return super().tick()


@pytest.mark.parametrize("stray", [OTHER, Following()], ids=["another controller", "nothing"])
def test_nothing_is_claimed_while_the_driver_does_not_obey(stray: Following) -> None:
    cell = Obedient()
    path: dict[str, Any] = {"command": "appendPath", "type": "joints", "data": [[0.5, *cell.arm.home[1:].tolist()]]}
    cell.ok("a", **path)
    cell.advance(0.3)
    epoch = cell.controller.access.epoch
    cell.stray = stray
    cell.advance(0.1)
    assert CrfCode.Disconnected in cell.get_status()["controllerStatus"]
    assert cell.get_status()["isTrajectoryRunning"]["value"] is False
    assert [event.name for event in cell.events][-1] == "controlLost"
    for request in (path, {"command": "setVelocity", "type": "joints", "data": [0.1] * 6}):
        refused = cell.ask("a", priority=10, **request)
        assert refused["message"]["code"] == CrfCode.Forbidden and "the arm driver follows" in refused["text"]
    cell.stray = None
    cell.advance(0.6)
    assert cell.controller.access.epoch != epoch, "what the driver followed before is void"
    cell.ok("a", **path)
    cell.until_rest()
    assert abs(cell.q[0] - 0.5) < 1e-9
    assert CrfCode.Disconnected not in cell.get_status()["controllerStatus"]


def ages(*lengths: tuple[int, int]) -> list[bool]:
    """What is late of states that follow a command so many periods old, for so many periods each."""
    delay, found, stamp = CommandDelay(PERIOD_NS), [], 10**9
    for age, count in lengths:
        for _ in range(count):
            found.append(delay.late(state(stamp, own(stamp, age * PERIOD_NS))))
            stamp += PERIOD_NS
    return found


@pytest.mark.parametrize("usual", [0, 1, 3], ids=["lockstep", "free", "with a latency of its own"])
def test_commands_that_reach_the_driver_later_than_usual(usual: int) -> None:
    found = ages((usual, 50), (usual + 1, 1), (usual + 2, 1), (usual + 9, 20), (usual, 50))
    assert not any(found[:51]), "one lost command is none"
    assert all(found[51:72])
    assert not any(found[72:])


def test_a_latency_that_stays_becomes_the_usual_one() -> None:
    found = ages((1, 50), (5, 1000))
    assert found[50] and not found[-1]


def test_a_driver_that_does_not_report_what_it_follows_is_in_time() -> None:
    delay = CommandDelay(PERIOD_NS)
    assert not any(delay.late(state(stamp, follows)) for stamp in (0, 10**9) for follows in (None, Following()))


class Starving(Obedient):
    """While ``held`` no command reaches it: it stands, and follows what it followed before."""

    held = False
    _reached: Following | None = None

    def tick(self) -> Any:
        if self.held:
            self.stray = self._reached
        else:
            self.stray, last = None, self.command
            self._reached = last and Following(token=last.token, answers=last.answers)
        return super().tick()

    def _move(self, command: ArmCommand) -> None:
        """With at most 25 rad/s², some 20 ms behind."""
        wanted = np.zeros(self.arm.n) if self.held else (np.array(command.values) - self.q) / 0.02
        before, self.dq = self.dq, self.dq + np.clip(wanted - self.dq, -0.1, 0.1)
        self.q = self.q + 0.5 * (before + self.dq) * PERIOD_NS * 1e-9


@pytest.mark.parametrize("reports", [True, False], ids=["the driver says so", "blocked, as far as is known"])
def test_an_arm_whose_commands_are_late_is_not_taken_to_be_blocked(reports: bool) -> None:
    """At 1 rad/s for 48 ms: 0.048 rad behind. Its driver, which follows an old command, cannot know better."""
    cell = Starving()
    cell.ok("a", command="appendPath", type="joints", data=[(UR5E.home + 1.0).tolist()])
    cell.advance(0.6)
    assert np.abs(cell.dq).max() > 0.9
    cell.held = True
    if not reports:
        cell._reached = None
    cell.advance(0.048)
    cell.held = False
    cell.advance(0.1)
    contacts = [event.info for event in cell.events if event.name == "contact"]
    assert [getattr(contact, "kind", None) for contact in contacts] == ([] if reports else ["following"])
