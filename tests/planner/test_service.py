"""The shell: what comes out of the bus for what goes in. The bus here is a list of events."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rackhand.bus import Presence, Sample
from rackhand.schemas import topics
from rackhand.schemas.base import Message, Pose2
from rackhand.schemas.chassis import ChassisRequest, LocalisedPose, Odometry, SetControlMode
from rackhand.schemas.moves import CreateMove, GetMove, MoveCreate, MoveRequest
from rackhand.schemas.service import ServiceId
from rackhand.services.planner.geometry.se2 import STANDSTILL
from rackhand.services.planner.service import PlannerService
from tests.planner.fakes import FORWARD, Cell, free_scan
from tests.runtime.list_bus import Asked, ListBus

DRIVER = ServiceId("driver", "amr1")
SIM = ServiceId("sim", "world")
MS = 1_000_000


class AtOnce:
    """A store whose changes are on disk when they are made."""

    submitted, path = 0, ""

    def on_settled(self, _: Any) -> None: ...

    def settle(self, settled: Any) -> None: ...


@pytest.fixture
def bus() -> ListBus:
    return ListBus()


@pytest.fixture
def cell(make_cell: Callable[..., Cell]) -> Cell:
    return make_cell()


def run(bus: ListBus, cell: Cell, *batches: list[Any]) -> None:
    bus.batches = [list(batch) for batch in batches]
    PlannerService(bus, "amr1", cell.chassis, AtOnce(), lambda: bus.now).run()  # type: ignore[arg-type]


def sample(topic: Any, message: Message) -> Sample:
    return Sample(topic, "amr1", message)


def odometry(milliseconds: int) -> Sample:
    pose = Pose2(x=0.0, y=0.0, yaw=0.0)
    message = Odometry(stamp=milliseconds * MS, pose=pose, twist=STANDSTILL, wheel_velocities=(0.0, 0.0))
    return sample(topics.ODOMETRY, message)


def pose(milliseconds: int) -> Sample:
    here = Pose2(x=0.0, y=0.0, yaw=0.0)
    return sample(topics.POSE, LocalisedPose(stamp=milliseconds * MS, pose=here, covariance=np.eye(3), quality=8))


def clock(cell: Cell, milliseconds: int, run: str = "first", **more: Any) -> Sample:
    return sample(topics.CLOCK, cell.clock().model_copy(update={"stamp": milliseconds * MS, "run": run} | more))


def instant(cell: Cell, milliseconds: int, run: str = "first") -> list[Any]:
    return [
        pose(milliseconds),
        sample(topics.SCAN, free_scan(milliseconds * MS)),
        odometry(milliseconds),
        clock(cell, milliseconds, run),
    ]


def create(**fields: Any) -> Asked:
    return Asked(topics.MOVES, MoveRequest(request=CreateMove(move=MoveCreate(target_x=1.0, target_y=1.0, **fields))))


def test_it_reads_and_serves_what_the_topic_table_says(bus: ListBus, cell: Cell) -> None:
    run(bus, cell, [])
    assert {row.name for row in bus.subscribed} == {
        row.name for row in (*topics.read_by("planner"), *topics.served_by("planner"))
    }


def test_each_period_gets_one_answer_and_a_repeated_instant_the_same(bus: ListBus, cell: Cell) -> None:
    run(bus, cell, *([odometry(t)] for t in (0, 20, 40, 40, 60, 80)))
    assert [command.answers // MS for command in bus.published(topics.COMMAND)] == [0, 40, 40, 80]
    assert bus.announced
    assert bus.published(topics.MAP)[0].map.map_name == "hall"


def test_a_planner_that_fell_behind_answers_the_newest(bus: ListBus, cell: Cell) -> None:
    run(bus, cell, [odometry(t) for t in (0, 20, 40, 60, 80, 100)])
    assert [command.answers // MS for command in bus.published(topics.COMMAND)] == [100]


def test_an_instant_is_answered_before_what_is_asked_after_it(bus: ListBus, cell: Cell) -> None:
    """However late the planner reads: a run must not depend on how much lies in its inbox at once."""
    asked = create()
    told: list[list[int]] = []
    reply = asked.reply
    asked.reply = lambda message: (told.append([c.answers for c in bus.published(topics.COMMAND)]), reply(message))[1]  # type: ignore[method-assign]
    run(bus, cell, [Presence(DRIVER, True), *instant(cell, 0), asked])
    assert told == [[0]]


def test_what_a_request_caused_is_reported_before_its_answer(bus: ListBus, cell: Cell) -> None:
    asked = create()
    reply, known = asked.reply, []
    asked.reply = lambda message: (known.append(bus.published(topics.PLANNING_STATE)[-1].move_state), reply(message))[1]  # type: ignore[method-assign]
    run(bus, cell, [Presence(DRIVER, True)], instant(cell, 0), [asked])
    assert known == ["moving"]
    assert asked.answer.moves[0].state == "moving"


def test_a_refusal_has_its_code_and_text(bus: ListBus, cell: Cell) -> None:
    asked = Asked(topics.MOVES, MoveRequest(request=GetMove(id=5)))
    run(bus, cell, [asked])
    assert asked.answer == ("not_found", "there is no move 5")


def test_an_error_in_a_request_is_answered_and_the_next_one_works(
    bus: ListBus, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: Any) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(cell.moves, "get", broken)
    first, second = Asked(topics.MOVES, MoveRequest(request=GetMove(id=5))), create()
    run(bus, cell, [Presence(DRIVER, True)], instant(cell, 0), [first, second])
    assert first.answer == ("internal", "the planner failed to answer; see its log")
    assert second.answer.moves[0].state == "moving"


def test_an_error_in_a_tick_fails_the_move_and_the_answers_go_on(bus: ListBus, cell: Cell) -> None:
    cell.script.ticks = [ZeroDivisionError("by zero")]
    first, second = create(), create()
    run(bus, cell, [Presence(DRIVER, True)], instant(cell, 0), [first], instant(cell, 40), [second], instant(cell, 80))
    assert [command.twist for command in bus.published(topics.COMMAND)] == [STANDSTILL, STANDSTILL, FORWARD]
    assert (cell.get(1).fail_reason, cell.get(2).state) == (1002, "moving")


def test_a_simulator_is_joined_once_the_footprint_is_known(bus: ListBus, cell: Cell) -> None:
    model = sample(topics.CHASSIS_MODEL, cell.chassis._state.model)  # type: ignore[arg-type]
    cell.chassis._state.model = None
    run(bus, cell, [Presence(ServiceId("gateway", "cell"), True)], [Presence(SIM, True)], instant(cell, 0))
    assert bus.calls == []
    run(bus, cell, [Presence(SIM, True)], [model], instant(cell, 0), instant(cell, 40), instant(cell, 0, "second"))
    assert len(bus.calls) == 2
    query, join = bus.calls[0]
    assert query is topics.WORLD_CONTROL
    assert (join.robot, join.service, join.period_ns) == ("amr1", "planner", 40 * MS)


def test_a_real_robot_is_driven_without_joining(bus: ListBus, cell: Cell) -> None:
    asked = create()
    run(bus, cell, instant(cell, 0), [asked], instant(cell, 40))
    assert bus.calls == []
    assert bus.published(topics.COMMAND)[-1].twist == FORWARD


@pytest.mark.parametrize("gone", [True, False])
def test_a_driver_that_disconnects_or_restarts_fails_the_move_and_the_next_works(
    bus: ListBus, cell: Cell, gone: bool
) -> None:
    first, second = create(), create()
    lost = [Presence(DRIVER, False)] if gone else []
    back = [Presence(DRIVER, True)] if gone else []
    run(
        bus,
        cell,
        [Presence(DRIVER, True)],
        instant(cell, 400),
        [first],
        instant(cell, 440),
        lost,
        back,
        instant(cell, 0, "second"),
        [second],
        instant(cell, 40, "second"),
    )
    text = "the chassis driver disconnected" if gone else "the chassis driver restarted"
    assert (cell.get(1).fail_reason, cell.get(1).fail_message) == (1000, f"{text} during the move")
    assert cell.get(2).state == "moving"
    assert [command.answers // MS for command in bus.published(topics.COMMAND)] == [400, 440, 0, 40]
    assert bus.published(topics.COMMAND)[-1].twist == FORWARD
    assert [status.driver_alive for status in bus.published(topics.CHASSIS_STATUS)][-1] is True


def test_a_silent_driver_fails_the_move_and_the_next_is_refused_until_it_publishes_again(
    bus: ListBus, cell: Cell
) -> None:
    def free(milliseconds: int) -> list[Any]:
        """Not in lockstep, where only the token counts."""
        return [pose(milliseconds), odometry(milliseconds), clock(cell, milliseconds, lockstep=False)]

    first, refused, second = create(), create(), create()
    run(
        bus,
        cell,
        [Presence(DRIVER, True)],
        free(400),
        [first],
        [0.9, *free(440)],
        [0.9, *free(480)],
        [2.0],
        [refused],
        free(520),
        [second],
        free(560),
    )
    silent = "the chassis driver sent no measurement for 1.5 s"
    assert (cell.get(1).fail_reason, cell.get(1).fail_message) == (1000, f"{silent} during the move")
    assert refused.answer == ("unavailable", silent)
    assert cell.get(2).state == "moving"
    assert [status.driver_alive for status in bus.published(topics.CHASSIS_STATUS)][-1] is True


def test_the_same_stamp_of_another_run_is_answered_again(bus: ListBus, cell: Cell) -> None:
    run(
        bus,
        cell,
        [Presence(DRIVER, True)],
        instant(cell, 0),
        [Presence(DRIVER, False)],
        [Presence(DRIVER, True)],
        instant(cell, 0, "second"),
    )
    assert [command.answers for command in bus.published(topics.COMMAND)] == [0, 0]


def test_modes_are_asked_for_on_their_own_query(bus: ListBus, cell: Cell) -> None:
    asked = Asked(topics.CHASSIS_REQUEST, ChassisRequest(request=SetControlMode(control_mode="manual")))
    run(bus, cell, [asked])
    assert asked.answer.detail == ""
    assert bus.published(topics.CHASSIS_STATUS)[-1].control_mode == "manual"
