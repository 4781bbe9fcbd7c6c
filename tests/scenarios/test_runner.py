"""The runner against a cell and an API that are played: what it requests, in which order, and what it undoes."""

# ruff: noqa: ARG002 - the fakes take what the real ones take

from __future__ import annotations

from typing import Any

import pytest

from rackhand.bus import Refused
from rackhand.scenarios.runner import Runner
from rackhand.schemas.base import NANOSECONDS, Message, Pose2
from rackhand.schemas.refusal import RefusalCode
from rackhand.schemas.world import Advance, Clock, Contact, InjectFault, Place, Reset, WorldReply
from rackhand.worlds.scenario_model import Scenario

Json = dict[str, Any]
END_AFTER = 3.0  # s of simulation time that a move takes
FAILED = {"state": "failed", "fail_reason": 16, "fail_message": "no usable scan"}


class World:
    """Time passes in ``Advance``; the robot drives 0.5 m/s along x while a move runs. ``log``: requests in order."""

    http = ""

    def __init__(self) -> None:
        self.now, self.run, self.log = 0.0, 0, list[Any]()
        self.contacts: tuple[Contact, ...] = ()
        self.refuse: type[Message] | None = None

    def ask(self, request: Message, timeout: float = 60.0) -> WorldReply:
        if self.refuse is not None and isinstance(request, self.refuse):
            raise Refused(RefusalCode.INVALID, "would overlap 'wall'")
        if isinstance(request, Reset):
            self.now, self.run = 0.0, self.run + 1
        if isinstance(request, Advance):
            self.now += request.duration_ns / NANOSECONDS
        else:
            self.log.append(request)
        return WorldReply(
            clock=Clock(
                stamp=round(self.now * NANOSECONDS), run=f"run{self.run}", step_ns=20_000_000, speed=None,
                paused=True, lockstep=True, unix_ns=0,
            ),
            seed=0, digest="", contact_count=len(self.contacts), contacts=self.contacts,
            participants=("amr1/planner",), command_stamps={"amr1": 0},
        )  # fmt: skip

    def true_pose(self, name: str) -> Pose2:
        return Pose2(x=0.5 * self.now, y=0.0, yaw=0.0)

    def use_no_map(self, robot: str) -> None:
        self.log.append(("no map", robot))

    def ask_lift(self, lift: str, fields: Json) -> None:
        self.log.append(("lift", lift, fields["op"]))

    def restart(self, service: str) -> None:
        self.log.append(("restart", service))


class Client:
    """Moves end after ``END_AFTER`` seconds: the first one as ``ending`` says, all others with success."""

    def __init__(self, world: World, **ending: Any) -> None:
        self._world, self._ending = world, FAILED | ending
        self._posted: list[float] = []
        self.requests: list[tuple[str, str]] = []

    def ask(self, method: str, path: str, body: Any = None, status: int | None = None) -> Any:
        self.requests.append((method, path))
        if path == "/chassis/jack":
            return {"state": "hold", "progress": 1.0}
        if path.startswith("/maps/"):
            geometry = {"grid_origin_x": 0.0, "grid_origin_y": 0.0, "grid_resolution": 0.05}
            return {"map_name": "m", "overlays": '{"features": []}'} | geometry
        return {"id": 1}

    def send(self, method: str, path: str, body: Any = None) -> tuple[int, bytes]:
        return 200, b'{"load": "free"}' if path == "/chassis/jack" else b"png"

    def post_move(self, body: Json) -> int:
        self.requests.append(("move", body["type"]))
        self._posted.append(self._world.now)
        return len(self._posted)

    def move(self, move_id: int) -> Json:
        if self._world.now - self._posted[move_id - 1] < END_AFTER:
            return {"id": move_id, "state": "moving", "fail_reason": 0, "fail_message": ""}
        success = {"state": "succeeded", "fail_reason": 0, "fail_message": ""}
        ending = self._ending if move_id == 1 else success
        text = {16: "control_costmap_error - 局部避障地图数据异常", 0: "None - None"}
        return {"id": move_id, "fail_reason_str": text[ending["fail_reason"]]} | ending

    def newest_state(self) -> Json:
        return {"move_intent": "none"}

    def final_state(self, move_id: int, state: str) -> Json:
        reason = {16: "MoveFailReason::control_costmap_error", 0: "none"}[self.move(move_id)["fail_reason"]]
        number = self.move(move_id)["fail_reason"]
        return {"action_id": move_id, "move_state": state, "fail_reason": number, "fail_reason_str": reason}


def scenario(timeline: list[Json], **more: Any) -> Scenario:
    content = {
        "name": "played",
        "shows": "What the runner does.",
        "world": "empty",
        "timeline": timeline,
        "expect": {"state": "failed", "reason": "control_costmap_error", "within": 10},
        "then": {"type": "standard", "target_x": 1.0},
    }
    return Scenario.model_validate(content | more)


MOVE: Json = {"move": {"type": "standard", "target_x": 4.0}}
DEAD: Json = {"faults": [{"fault": "lidar_dead"}]}


def play(played: Scenario, **ending: Any) -> tuple[Any, World, Client]:
    world = World()
    client = Client(world, **ending)
    return Runner(world, client).run(played), world, client  # type: ignore[arg-type]


def test_a_scenario_passes_and_what_it_changed_is_undone() -> None:
    place: Json = {"place": {"crate": {"at": [3, 0, 0]}}}
    steps = [MOVE, {"when": {"driven": 0.5}, **DEAD}, place, {"settings": {"a": 1}}, {"map": "none"}]
    verdict, world, client = play(scenario(steps))
    assert verdict.problems == () and verdict.passed
    assert (verdict.state, verdict.fail_reason, verdict.took) == ("failed", 16, pytest.approx(END_AFTER, abs=0.3))
    faults = [request.active for request in world.log if isinstance(request, InjectFault)]
    assert faults == [True, False]
    assert [request.op for request in world.log if getattr(request, "name", "") == "crate"] == ["place", "remove"]
    assert ("no map", "amr1") in world.log
    assert ("PATCH", "/system/settings/user") in client.requests and (
        "POST",
        "/system/settings/user",
    ) in client.requests
    assert client.requests.index(("POST", "/chassis/current-map")) < client.requests.index(("move", "standard"), 5)


def test_a_step_waits_for_its_condition() -> None:
    steps = [MOVE, {"when": {"driven": 1.0}, **DEAD}]
    _, world, _ = play(scenario(steps, then={"type": "standard"}))
    assert isinstance(world.log[-2], InjectFault) or any(isinstance(r, InjectFault) for r in world.log)
    broken, _, client = play(scenario([MOVE, {"when": {"planning_state": {"move_intent": "x"}, "within": 2}, **DEAD}]))
    assert "2 s of simulation time passed before this: step 2" in broken.problems[0]
    assert client.requests.count(("move", "standard")) == 2, "the next job is tried all the same"


def test_a_move_that_does_not_end_in_time_is_a_problem() -> None:
    expect = {"state": "failed", "reason": "control_costmap_error", "within": 0.5}
    verdict, _, _ = play(scenario([MOVE], expect=expect))
    assert verdict.took is None or verdict.took > 0.5
    assert verdict.problems and "expected" in verdict.problems[0]


def test_a_next_job_that_fails_is_a_problem() -> None:
    success = {"state": "succeeded", "within": 10}
    verdict, _, _ = play(scenario([MOVE], expect=success, then=None), state="succeeded", fail_reason=0, fail_message="")
    assert verdict.passed
    world = World()
    client = Client(world)
    client.move = lambda move_id: FAILED | {"id": move_id, "fail_reason_str": "x"}  # type: ignore[method-assign]
    client.final_state = lambda *_: {}  # type: ignore[method-assign]
    verdict = Runner(world, client).run(scenario([MOVE]))  # type: ignore[arg-type]
    assert any("the next job" in problem and "failed with 16" in problem for problem in verdict.problems)


def test_contacts_are_judged_and_refusals_are_problems() -> None:
    world = World()
    world.contacts = (Contact(stamp=0, robot="amr1", other="crate", force=1.0),)
    verdict = Runner(world, Client(world)).run(scenario([MOVE]))  # type: ignore[arg-type]
    assert verdict.problems == ("1 contacts, with crate; expected at most 0",)
    world = World()
    world.refuse = Place
    verdict = Runner(world, Client(world)).run(scenario([{"place": {"crate": {"at": [0, 0, 0]}}}, MOVE]))  # type: ignore[arg-type]
    assert verdict.problems[0] == "would overlap 'wall'" and verdict.state == "not requested"


def test_services_lifts_and_the_jack_are_commanded() -> None:
    steps = [{"jack": "up", "lift": {"lift_1": {"op": "call", "floor": "floor1"}}}, {"kill": "planner"}, MOVE]
    verdict, world, client = play(scenario(steps))
    assert verdict.passed
    assert ("lift", "lift_1", "call") in world.log and ("restart", "planner") in world.log
    assert ("POST", "/services/jack_up") in client.requests
