"""A driver that does not follow this controller is noticed, by the watch and by the controller."""

from __future__ import annotations

from typing import Any

import pytest

from rackhand.schemas.crf import CrfCode
from rackhand.schemas.motion import ArmState, FencingToken, Following
from rackhand.services.controller.motion.driver_watch import DriverWatch
from tests.controller.cell import PERIOD_NS, PerfectArm

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
    watch = DriverWatch()
    faults = [watch.fault(state(t, follows(t)), "e1") for t in range(10**9, 2 * 10**9, PERIOD_NS)]
    assert not any(faults[:10]), "a command needs its way"
    assert said in faults[-1] and bool(faults[-1]) == bool(said)


def test_a_command_that_is_lost_once_is_no_fault() -> None:
    watch = DriverWatch()
    for t in range(0, 10**9, PERIOD_NS):
        lost = t // 40_000_000 % 3 == 0
        assert not watch.fault(state(t, Following() if lost else own(t)), "e1")


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
