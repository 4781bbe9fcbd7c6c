"""A command is one row: one is added here, and none of the schema's may be missing."""

from __future__ import annotations

import importlib
from typing import Annotated, Any, Literal

import pytest
from pydantic import Field

from rackhand.schemas import crf_requests as crf
from rackhand.schemas.motion import RobotConfiguration
from rackhand.services.controller.arm_control import ArmControl
from rackhand.services.controller.commands import locking, paths, reading, references, settings, table
from rackhand.services.controller.commands.spec import (
    CommandSpec,
    CommandTable,
    CommandTableError,
    GrantedCommand,
    OnAccess,
    OnArm,
    Result,
)
from rackhand.services.controller.commands.table import COMMANDS
from rackhand.services.controller.protocol.answers import Answer, reply
from rackhand.services.controller.protocol.context import RequestContext
from tests.controller.cell import PerfectArm
from tests.controller.protocol.bench import OK, PATH, Bench

MODULES = (locking, paths, references, settings, reading)
ROWS = [(module, spec) for module in MODULES for spec in module.SPECS]


class Nudge(crf.ControlRequest):
    """A toy: moves the first joint by a little."""

    command: Literal["nudge"]
    angle: Annotated[float, Field(description="rad")]


def nudge(request: Nudge, arm: ArmControl, granted: GrantedCommand) -> Result | None:
    def append(queue: Any, t: float) -> Any:
        target = arm.motion.q.copy()
        target[0] += request.angle
        return queue.append_joints(t, [target])

    return arm.append("joints", append, 1, granted)


def check(request: Nudge, arm: RobotConfiguration) -> str:
    return "" if abs(request.angle) <= 0.2 else f"angle {request.angle:g} rad, at most 0.2"


NUDGE = CommandSpec(Nudge, OnArm(nudge), moves=True, audited=True, once=True, check=check)
WITH_NUDGE = CommandTable((*COMMANDS, NUDGE))


def test_a_command_added_as_one_row_moves_the_arm_under_priority_access() -> None:
    cell = PerfectArm(commands=WITH_NUDGE)
    before = cell.q.copy()
    cell.ask("b", command="lockControl", priority=5)
    refused = cell.ask("a", command="nudge", priority=10, angle=0.1)
    assert (refused["replyCommand"], refused["message"]) == ("nudge", {"code": 403, "detail": 0})
    cell.ask("b", command="unlockControl", priority=5)
    far = cell.ask("a", command="nudge", priority=10, angle=0.3)
    assert (far["message"], far["text"]) == ({"code": 400, "detail": 0}, "angle 0.3 rad, at most 0.2")
    cell.ok("a", command="nudge", angle=0.1, id=1)
    cell.until_rest()
    assert cell.q[0] - before[0] == pytest.approx(0.1, abs=1e-9)
    assert [entry.action for entry in cell.audit].count("nudge") == 2, "refused for control, and granted"
    cell.ok("a", command="nudge", angle=0.1, id=1)
    cell.until_rest()
    assert cell.q[0] - before[0] == pytest.approx(0.1, abs=1e-9), "a retry is not executed again"


def test_a_command_added_as_one_row_may_be_answered_in_the_protocol_layer() -> None:
    class WhoAmI(crf.Request):
        command: Literal["whoAmI"]

    def run(request: WhoAmI, context: RequestContext) -> Answer:
        return reply(request.command, context.caller.client)

    bench = Bench(commands=CommandTable((*COMMANDS, CommandSpec(WhoAmI, OnAccess(run)))))
    assert bench.ask("a", command="whoAmI", client="cell")["message"] == "cell"
    assert bench.ask("a", **PATH)["message"] == OK
    assert Bench().ask("a", command="whoAmI")["message"] == "Unknown command: whoAmI"


@pytest.mark.parametrize(("module", "spec"), ROWS, ids=[spec.model.__name__ for _, spec in ROWS])
def test_a_command_of_the_schema_without_a_row_is_an_error_at_import(
    module: Any, spec: CommandSpec[Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "SPECS", tuple(each for each in module.SPECS if each is not spec))
    with pytest.raises(CommandTableError, match=f"no CommandSpec for {spec.model.__name__}"):
        importlib.reload(table)


def test_every_row_is_of_the_schema_and_every_name_finds_its_rows() -> None:
    assert {spec.model for spec in COMMANDS} == set(crf.REQUESTS)
    assert [spec.model for spec in COMMANDS.named("appendPath")] == [crf.AppendJointsPath, crf.AppendTaskPath]
    assert COMMANDS.named("nudge") == ()


def test_rows_that_cannot_be_reported_apart_are_refused() -> None:
    with pytest.raises(CommandTableError, match="same model"):
        CommandTable((*COMMANDS, next(iter(COMMANDS))))

    class AnotherStatus(crf.Request):
        command: Literal["getStatus"]

    with pytest.raises(CommandTableError, match="getStatus"):
        CommandTable((*COMMANDS, CommandSpec(AnotherStatus, OnAccess(lambda *_: reply("", True)))))


def test_what_moves_needs_control_and_what_is_not_granted_is_not_audited() -> None:
    for spec in COMMANDS:
        if spec.moves or spec.audited or spec.resumes:
            assert issubclass(spec.model, crf.ControlRequest), spec.model
            assert isinstance(spec.execute, OnArm)
