"""What the controller's command line refuses before anything is started."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from rackhand.schemas.crf_requests import OPTIONAL_COMMANDS
from rackhand.services.controller.__main__ import app


@pytest.mark.parametrize("how", ["option", "environment"])
def test_a_command_that_cannot_be_left_out_is_reported(how: str) -> None:
    given = ["--without", "softStop"] if how == "option" else []
    environment = {"RACKHAND_CONTROLLER_WITHOUT": "setVelocity softStop"} if how == "environment" else {}
    result = CliRunner().invoke(app, given, env=environment)
    assert result.exit_code == 2
    assert "softStop: want one of" in " ".join(result.output.replace("│", " ").split())


def test_stops_questions_and_locks_are_always_offered() -> None:
    assert {"appendPath", "setVelocity", "setTorque"} <= OPTIONAL_COMMANDS
    assert not OPTIONAL_COMMANDS & {"softStop", "hardStop", "getStatus", "lockControl", "resumeControl", "heartbeat"}
