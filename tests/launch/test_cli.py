"""The command line: what it says, and what it refuses before anything is started."""

from __future__ import annotations

import fcntl
import socket
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rackhand.bus import BusConfig
from rackhand.schemas.topics import QUERIES, TOPICS
from rackhand.services.launch.cell import crf_addresses
from rackhand.services.launch.cli import app
from rackhand.services.launch.processes import Address, CellOptions, cell_processes
from rackhand.services.launch.viewing import with_viewer
from rackhand.worlds.data import WorldFileError
from tests.launch.conftest import Running

cli = CliRunner()
HEAD = "version: 1\nname: mine\nbounds: [0, 0, 5, 5]\n"
ROBOTS = f"{HEAD}robots: {{amr1: {{profile: longjack, pose: [1, 1, 0]}}}}\n"
ARMS = f"{HEAD}arms: {{arm1: {{kind: fr3, pose: [1, 1, 0]}}, arm2: {{kind: ur5e, pose: [4, 1, 0]}}}}\n"
RACKHAND = [sys.executable, "-m", "rackhand.services.launch"]


@pytest.fixture
def up(tmp_path: Path) -> list[str]:
    """``rackhand up`` on free ports, with a world whose folder exists."""
    world = tmp_path / "world"
    world.mkdir()
    (world / "world.yaml").write_text(ROBOTS)
    return ["up", "--world", str(world), "--port", "0", "--bus-port", "0", "--viewer-port", "0"]


def test_help_names_every_command() -> None:
    shown = cli.invoke(app, ["--help"]).output
    for command in ("up", "prepare", "status", "world", "scenario", "sweep", "topics", "motion", "record", "view"):
        assert f"\n  {command} " in shown


@pytest.mark.parametrize("command", ["up", "prepare", "status", "topics", "motion", "record", "view"])
def test_help_of_every_command_shows_examples(command: str) -> None:
    shown = cli.invoke(app, [command, "--help"]).output
    assert f"Examples:\n    rackhand {command}" in shown


@pytest.mark.parametrize("flag", [[], ["--markdown"]])
def test_topics_prints_every_row(flag: list[str]) -> None:
    result = cli.invoke(app, ["topics", *flag])
    assert result.exit_code == 0
    for key, text in [(t.key, t.text) for t in TOPICS] + [(q.key, q.text) for q in QUERIES]:
        assert key.replace("{robot}", "<robot>") in result.output
        assert text in result.output


@pytest.mark.parametrize("speed", ["0", "-1", "fast", "1001", "nan", "inf"])
def test_a_bad_speed_is_refused(speed: str) -> None:
    result = cli.invoke(app, ["up", "--speed", speed])
    assert result.exit_code == 2
    assert "want max, or a factor" in result.output


def test_a_world_that_is_not_there_is_reported(tmp_path: Path) -> None:
    result = cli.invoke(app, ["up", "--world", "atlantis", "--state-dir", str(tmp_path / "var")])
    assert result.exit_code == 1
    assert "'atlantis' is neither a world (empty, pick_station, warehouse) nor a folder" in " ".join(
        result.output.split()
    )
    assert not (tmp_path / "var").exists()


def test_options_reach_the_services() -> None:
    options = CellOptions(world="empty", speed=None, lockstep=True, seed=7, profile="jackal", state_dir=Path("here"))
    table = {process.name: process for process in cell_processes(options, {})}
    sim = " ".join(table["sim"].argv)
    for part in ("--world empty", "--speed max", "--lockstep", "--seed 7", "jackal", "amr1/planner"):
        assert part in sim
    assert "here" in " ".join(table["planner"].argv)
    assert all(
        process.env["RACKHAND_BUS_CONNECT"] == "tcp/127.0.0.1:7447"
        for name, process in table.items()
        if name != "router"
    )


def test_in_lockstep_no_process_is_taken_for_gone_because_the_machine_is_busy(monkeypatch: pytest.MonkeyPatch) -> None:
    patient = cell_processes(CellOptions(lockstep=True), {})
    assert {process.env.get("RACKHAND_BUS_LEASE") for process in patient} == {"30"}
    assert not any("RACKHAND_BUS_LEASE" in process.env for process in cell_processes(CellOptions(), {}))
    assert '"lease":1000' in lease_of(BusConfig())
    monkeypatch.setenv("RACKHAND_BUS_LEASE", "30")
    assert '"lease":30000' in lease_of(BusConfig())


def lease_of(config: BusConfig) -> str:
    return str(config.zenoh_config().get_json("transport/link/tx")).replace(" ", "")


def test_the_world_says_who_acts(tmp_path: Path) -> None:
    place = "{profile: longjack, pose: [1, 1, 0]}"
    content = f"{HEAD}robots: {{amr1: {place}, amr2: {place}}}\narms: {{arm1: {{kind: fr3, pose: [1, 1, 0]}}}}\n"
    (tmp_path / "world.yaml").write_text(content)
    table = {process.name: process for process in cell_processes(CellOptions(world=str(tmp_path)), {})}
    assert list(table) == ["router", "sim", "planner-amr1", "planner-amr2", "controller", "gateway", "viewer"]
    controller = " ".join(table["controller"].argv)
    own = f"--robot arm1 --arm fr3 --world {tmp_path} --state-dir var/arm1 --rate 250"
    assert controller.endswith(f"rackhand.services.controller {own}")
    sim, gateway = " ".join(table["sim"].argv), " ".join(table["gateway"].argv)
    for participant in ("amr1/planner", "amr2/planner", "arm1/controller"):
        assert f"--wait-for {participant}" in sim and f"--expect {participant}" in gateway
    assert "--arm arm1" in gateway
    assert "--robot amr1" in gateway and "--expect world/sim" in gateway


def test_a_world_of_arms_needs_no_planner() -> None:
    table = {process.name: process for process in cell_processes(CellOptions(world="pick_station"), {})}
    assert list(table) == ["router", "sim", "controller", "gateway", "viewer"]
    assert "planner" not in " ".join((*table["sim"].argv, *table["gateway"].argv))


def test_another_arm_reaches_simulator_and_controller() -> None:
    table = {process.name: process for process in cell_processes(CellOptions(world="pick_station", arm="fr3"), {})}
    assert "--arm fr3" in " ".join(table["sim"].argv) and "--arm fr3" in " ".join(table["controller"].argv)
    with pytest.raises(WorldFileError, match="arm 'fr4' is not known; known: "):
        cell_processes(CellOptions(world="pick_station", arm="fr4"), {})


def test_without_a_simulator_the_gateway_expects_a_driver_for_each_robot_that_is_served() -> None:
    options = CellOptions(world="empty", sim=False)
    table = {process.name: process for process in cell_processes(options, {})}
    assert list(table) == ["router", "planner", "controller", "gateway", "viewer"]
    expected = [table["gateway"].argv[i + 1] for i, word in enumerate(table["gateway"].argv) if word == "--expect"]
    assert expected == ["cell/router", "amr1/driver", "arm1/driver", "amr1/planner", "arm1/controller"]
    table = {process.name: process for process in cell_processes(replace(options, robots=("amr1",)), {})}
    assert list(table) == ["router", "planner", "gateway", "viewer"]
    expected = [table["gateway"].argv[i + 1] for i, word in enumerate(table["gateway"].argv) if word == "--expect"]
    assert expected == ["cell/router", "amr1/driver", "amr1/planner"]


def test_a_robot_that_the_world_does_not_have_is_refused(tmp_path: Path) -> None:
    told = cli.invoke(app, ["up", "--world", "empty", "--robot", "amr9", "--state-dir", str(tmp_path)])
    assert told.exit_code == 1
    assert "--robot amr9: robots of empty are ['amr1', 'arm1']" in " ".join(told.output.split())


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("robots: [", "not YAML"),
        (HEAD + "robots: [amr1]", "robots: Input should be a valid dictionary"),
        (HEAD + "arms: {arm1: {pose: [0, 0, 0]}}", "arms.arm1.kind: Field required"),
        (HEAD + "arms: {arm1: {kind: ur6, pose: [0, 0, 0]}}", "arms.arm1.kind: arm 'ur6' is not known"),
        (HEAD + "robots: {amr1: {profile: tank, pose: [0, 0, 0]}}", "chassis profile 'tank' is not known"),
    ],
)
def test_a_world_file_that_is_wrong_is_refused_before_anything_starts(
    up: list[str], tmp_path: Path, text: str, told: str
) -> None:
    (tmp_path / "world" / "world.yaml").write_text(text)
    result = cli.invoke(app, [*up, "--state-dir", str(tmp_path / "var")])
    assert result.exit_code == 1
    assert told in " ".join(result.output.split())
    assert not (tmp_path / "var").exists()


def test_crf_ports_go_to_the_arms_in_order(tmp_path: Path) -> None:
    (tmp_path / "world.yaml").write_text(ARMS)
    options = CellOptions(world=str(tmp_path), crf_port=5000)
    table = {p.name: p for p in cell_processes(replace(options, crf=crf_addresses(options)), {})}
    assert "--crf-port arm1=5000 --crf-port arm2=5001" in " ".join(table["gateway"].argv)
    assert [address.port for address, _ in table["gateway"].ports] == [5000, 5001]
    free = crf_addresses(replace(options, crf_port=0))
    assert len({address.port for address in free.values()} - {0}) == 2
    assert crf_addresses(CellOptions(world=str(tmp_path))) == {}


@pytest.mark.parametrize(("world", "port", "told"), [
    (ROBOTS, "5000", "there is no arm in world"),
    (ARMS, "65535", "2 arms from 65535 on, ports end at 65535"),
])  # fmt: skip
def test_crf_ports_that_cannot_be_are_reported(up: list[str], tmp_path: Path, world: str, port: str, told: str) -> None:
    (tmp_path / "world" / "world.yaml").write_text(world)
    result = cli.invoke(app, [*up, "--crf-port", port, "--state-dir", str(tmp_path / "var")])
    assert result.exit_code == 1
    assert told in result.output


def test_a_crf_port_in_use_is_reported(up: list[str], tmp_path: Path) -> None:
    (tmp_path / "world" / "world.yaml").write_text(ARMS)
    with socket.create_server(("127.0.0.1", 0)) as holder:
        port = holder.getsockname()[1]
        result = cli.invoke(app, [*up, "--crf-port", str(port), "--state-dir", str(tmp_path / "var")])
    assert result.exit_code == 1
    assert f"gateway cannot listen on 127.0.0.1:{port}" in result.output and "with --crf-port." in result.output


def test_a_bus_elsewhere_becomes_the_routers_neighbour() -> None:
    elsewhere = "tls/fleet.example:7447"
    router, sim, *_ = cell_processes(CellOptions(), {"RACKHAND_BUS_CONNECT": elsewhere})
    assert router.argv[-2:] == ("--connect", elsewhere)
    assert sim.env["RACKHAND_BUS_CONNECT"] == "tcp/127.0.0.1:7447"


def test_a_cell_whose_view_has_no_port_goes_without(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as holder:
        taken = Address("127.0.0.1", holder.getsockname()[1])
        blind, told = with_viewer(CellOptions(viewer=taken))
        seeing, _ = with_viewer(CellOptions(viewer=Address("127.0.0.1", 0), viewer_data=taken))
    assert blind.viewer is None and blind.viewer_page is None
    assert f"the live view cannot listen on {taken}: Address already in use" in told and "--viewer-port" in told
    assert "viewer" not in [process.name for process in cell_processes(blind, {})]
    assert seeing.viewer is not None and seeing.viewer.port
    assert seeing.viewer_data.port not in (0, taken.port), "data come from any free port"


def test_the_live_view_is_reported_where_to_listen() -> None:
    viewer = cell_processes(CellOptions(), {})[-1]
    assert viewer.name == "viewer" and viewer.optional
    assert " ".join(viewer.argv).endswith("rackhand.services.viewer --host 127.0.0.1 --web-port 9090 --data-port 9876")
    assert CellOptions().viewer_page == "http://127.0.0.1:9090/"


def test_there_must_be_something_to_view(tmp_path: Path) -> None:
    result = cli.invoke(app, ["view", str(tmp_path / "none.rrd"), "--state-dir", str(tmp_path)])
    assert result.exit_code == 1 and f"there is no file {tmp_path / 'none.rrd'}" in result.output
    result = cli.invoke(app, ["record", str(tmp_path / "no" / "run.rrd"), "--state-dir", str(tmp_path)])
    assert result.exit_code == 1 and f"there is no folder {tmp_path / 'no'}" in result.output


@pytest.mark.parametrize("taken", ["--port", "--bus-port"])
def test_a_port_in_use_is_reported_before_anything_starts(tmp_path: Path, up: list[str], taken: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as holder:
        port = holder.getsockname()[1]
        result = cli.invoke(app, [*up, taken, str(port), "--state-dir", str(tmp_path / "var")])
    assert result.exit_code == 1
    assert f"cannot listen on 127.0.0.1:{port}: Address already in use" in result.output
    assert f"with {taken}." in result.output
    assert not (tmp_path / "var").exists()


def test_a_state_folder_serves_one_cell(tmp_path: Path, up: list[str]) -> None:
    with (tmp_path / "cell.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        result = cli.invoke(app, [*up, "--state-dir", str(tmp_path)])
    assert result.exit_code == 1
    assert "another cell runs on the state folder" in result.output


def test_a_state_folder_that_cannot_be_made_is_reported(tmp_path: Path, up: list[str]) -> None:
    (tmp_path / "file").write_text("")
    result = cli.invoke(app, [*up, "--state-dir", str(tmp_path / "file" / "var")])
    assert result.exit_code == 1
    assert "cannot be used: Not a directory" in result.output


def test_status_without_a_cell_says_so(tmp_path: Path) -> None:
    url = Address("127.0.0.1", 9).url
    result = cli.invoke(app, ["status", "--url", url, "--state-dir", str(tmp_path)])
    assert result.exit_code == 1
    assert f"no gateway answers at {url}" in result.output


def test_motion_without_a_cell_says_so(tmp_path: Path) -> None:
    url = Address("127.0.0.1", 9).url
    result = cli.invoke(app, ["motion", "arm1", "{}", "--url", url, "--state-dir", str(tmp_path)])
    assert result.exit_code == 1
    assert f"no gateway answers at {url}" in result.output


def test_runs_as_a_module(run: Callable[[list[str]], Running]) -> None:
    running = run([*RACKHAND, "topics"])
    assert running.end() == 0
    assert "rackhand/world/clock" in "\n".join(running.lines)
