"""The command lines of the simulator and of ``rackhand world``."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from rackhand.services.sim.__main__ import app
from rackhand.worlds.data import installed_worlds


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--world", "nowhere"], "'nowhere' is neither a world"),
        (["--speed", "fast"], "or max"),
        (["--speed", "0"], "above 0"),
        (["--wait-for", "planner"], "want ROBOT/SERVICE"),
        (["--wait-for", "amr7/planner"], "robots of warehouse: ['amr1', 'arm1']"),
        (["--profile", "tank"], "known: ['jackal', 'longjack']"),
        (["map", "nowhere"], "'nowhere' is neither a world"),
        (["from-barn", "no.json", "1", "out"], "no.json: cannot be read"),
    ],
)
def test_wrong_options_end_with_status_2_and_say_why(arguments: list[str], told: str) -> None:
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 2
    assert told in " ".join(result.output.replace("│", " ").split())


def test_map_writes_where_it_is_reported(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["map", "warehouse", "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert (tmp_path / "map.png").read_bytes() == (installed_worlds() / "warehouse" / "map.png").read_bytes()
