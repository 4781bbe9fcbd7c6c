"""Running free, commands arrive late: no contact, and a contact is noticed all the same. Both arms in physics."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest

from rackhand.schemas import topics
from rackhand.schemas.arrays import Array
from rackhand.schemas.base import Pose2
from rackhand.schemas.crf_contact import Contact
from rackhand.schemas.motion import ArmCommand, ArmState
from rackhand.schemas.world import Place
from rackhand.services.controller import ik
from rackhand.services.controller.controller import Controller
from rackhand.services.controller.warm_up import Inline
from rackhand.services.sim.simulation import Simulation
from tests.joined.arm import PERIOD_NS, warm_arm
from tests.joined.conftest import pick_station

STEP_NS = 2_000_000
ARRIVES = ((1, 2), (1, 6))  # control steps after the state, at random: a machine with time, and a busy one


class LateArm:
    """A controller and the simulator, between which commands take ``arrives`` control steps; every hundredth state does
    not come at all, nor do the next four."""

    def __init__(self, kind: str, arrives: tuple[int, int], lost: float = 0.01) -> None:
        self.arm = warm_arm(kind)
        self.simulation = Simulation(pick_station(kind), {}, 0)
        self.simulation.arms["arm1"].efforts.period = PERIOD_NS // STEP_NS
        self.core = Controller(self.arm, PERIOD_NS, Inline(), lambda: "e1")
        self.states: list[ArmState] = []
        self.contacts: list[Contact] = []
        self._arrives, self._lost, self._random = arrives, lost, np.random.default_rng(1)
        self._under_way: list[tuple[int, ArmCommand]] = []
        self._away = -1

    def ask(self, **request: Any) -> None:
        self.core.request("a", json.dumps({"priority": 10, **request}), None)

    def drive(self, *points: Array) -> None:
        for point in points:
            self.ask(command="appendPath", type="joints", data=[point.tolist()])

    def advance(self, seconds: float) -> None:
        end = self.simulation.stamp + round(seconds * 1e9)
        while self.simulation.stamp < end:
            stamp = self.simulation.stamp
            if stamp % PERIOD_NS == 0:
                self._tick(stamp)
            while self._under_way and self._under_way[0][0] <= stamp:
                self.simulation.command("arm1", self._under_way.pop(0)[1])
            self.simulation.step()

    def _tick(self, stamp: int) -> None:
        state = next(output.message for output in self.simulation.outputs if output.topic is topics.ARM_STATE)
        self.states.append(state)
        if stamp <= self._away:
            return
        if self._random.random() < self._lost:
            self._away = stamp + 4 * PERIOD_NS
            return
        command = self.core.tick(state, lockstep=True)
        for event in self.core.take().events:
            if isinstance(event.info, Contact):
                self.contacts.append(event.info)
        late = int(self._random.integers(self._arrives[0], self._arrives[1] + 1)) * STEP_NS
        before = self._under_way[-1][0] if self._under_way else 0
        self._under_way.append((max(stamp + late, before), command))


@pytest.mark.parametrize("arrives", ARRIVES)
@pytest.mark.parametrize("kind", ["ur5e", "fr3"])
def test_motion_whose_commands_come_late_is_no_contact_and_smooth(kind: str, arrives: tuple[int, int]) -> None:
    station = LateArm(kind, arrives)
    arm, home = station.arm, station.arm.home
    station.advance(0.04)
    bend = np.append([0.9, -0.5, 0.6, -0.4], np.zeros(arm.n - 4))
    station.drive(home + bend, home - bend / 2)
    station.advance(2.0)
    assert station.contacts == []
    assert np.ptp([state.q[0] for state in station.states]) > 1.0
    gained = np.abs(np.diff([state.dq for state in station.states], axis=0)) / (PERIOD_NS * 1e-9)
    assert (gained.max(axis=0) < 2.0 * arm.limits.acceleration).all()


@pytest.mark.parametrize("kind", ["ur5e", "fr3"])
def test_a_crate_in_the_way_is_noticed_though_commands_come_late(kind: str) -> None:
    station = LateArm(kind, ARRIVES[1])
    arm, home = station.arm, station.arm.home
    station.advance(0.04)
    turned = home - 0.6 * np.eye(arm.n)[0]
    x, y = on_the_map(station.simulation, arm, turned)
    crate = Place(name="crate", kind="box", pose=Pose2(x=x, y=y, yaw=0.0), size=(0.12, 0.12, 1.6))
    station.simulation.change(crate)
    station.ask(command="setProfileVelocity", type="joints", data=(0.3 * arm.limits.velocity).tolist())
    station.drive(home - 0.9 * np.eye(arm.n)[0])
    station.advance(2.0)
    assert station.contacts and station.contacts[0].stopped
    assert [(row.robot, row.other) for row in station.simulation.contact_log.rows] == [("arm1", "crate")]
    assert station.states[-1].q[0] - home[0] > -0.75, "the crate is in the way"
    assert not station.core.motion.running


def on_the_map(simulation: Simulation, arm: ik.Arm, q: Array) -> tuple[float, float]:
    x, y, yaw = simulation.world.arms["arm1"].pose
    tool, c, s = ik.forward(arm, q)[:, 3], math.cos(yaw), math.sin(yaw)
    return x + c * tool[0] - s * tool[1], y + s * tool[0] + c * tool[1]
