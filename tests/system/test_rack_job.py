"""A whole rack job in a real cell, the planner killed in every stage of it, by a client that reads only the API; the
judge alone knows where the rack is."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import pytest

from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.testing import Cell, Judge, distance, turn, without_arms
from tests.system.api_client import ApiClient

FROM, TO = (7.8, 9.4), (5.8, 9.4)  # rack points s8, which has a rack, and s7, which has none
ASIDE = (5.5, 7.5)
RACK, UP = "rack_s8", math.pi / 2
WIDTH, WITH_RACK = 0.46, 0.93  # m, of /robot_model: body; a standard rack with its margins


@pytest.fixture
def job(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Job]:
    """In lockstep; the world goes on without the planner. No test of timing, so a busy machine does not matter."""
    world = without_arms(tmp_path_factory.mktemp("world"))
    with (
        Cell(tmp_path_factory.mktemp("cell"), world=world, seed=7) as cell,
        Judge(cell.bus) as judge,
        ApiClient(cell.http) as client,
    ):
        yield Job(cell, judge, client)


class Job:
    """A rack is carried from ``FROM`` to ``TO``."""

    def __init__(self, cell: Cell, judge: Judge, client: ApiClient) -> None:
        self.cell, self.judge, self.client = cell, judge, client

    # -- what the API says -------------------------------------------------------------------------------------------

    def load(self, expected: str) -> None:
        self.client.see("/load_state", lambda load: load["state"] == expected, f"the load is {expected}")
        assert self.client.order("GET", "/chassis/jack")["load"] == expected

    def width(self, expected: float) -> None:
        self.client.see("/robot_model", lambda model: abs(model["width"] - expected) < 0.03, f"{expected} m wide")

    def progress(self) -> float:
        return float(self.client.order("GET", "/chassis/jack")["progress"])

    def near(self, place: tuple[float, float], within: float, what: str) -> None:
        self.client.see("/tracked_pose", lambda pose: math.dist(pose["pos"], place) < within, what)

    def driven(self, metres: float) -> None:
        start = self.place()
        self.client.see("/tracked_pose", lambda at: math.dist(at["pos"], start) > metres, f"it drives {metres} m")

    # -- what is done ------------------------------------------------------------------------------------------------

    def start_align(self) -> int:
        return self.client.post("align_with_rack", target_x=FROM[0], target_y=FROM[1], target_ori=UP)

    def start_carrying(self) -> int:
        return self.client.post("to_unload_point", target_x=TO[0], target_y=TO[1], target_ori=UP)

    def start_leaving(self) -> int:
        return self.client.post("standard", target_x=ASIDE[0], target_y=ASIDE[1])

    def succeed(self, start: Callable[[], int]) -> None:
        move = self.client.finish(start())
        assert move["state"] == "succeeded", move

    def kill_planner(self, move: int | None = None) -> None:
        """Until it is back; ``move``: what ran, whose record and state then say how it ended."""
        former = self.cell.kill("planner")
        self.cell.wait_until_restarted("planner", former)
        self.cell.wait_until_up()
        if move is not None:
            record = self.client.order("GET", f"/chassis/moves/{move}")
            assert (record["state"], record["fail_reason"]) == ("failed", MoveFailReason.PLATFORM_ALERT_ERROR), record
            self.client.see(
                "/planning_state",
                lambda state: state["action_id"] == move and state["move_state"] == "failed",
                "the move is told to have failed",
            )

    def kill_planner_in_the_stroke(self, load: str) -> None:
        """The jack stops with its commander, and nothing drives before it has arrived."""
        self.client.see("/jack_state", lambda jack: 0.1 < jack["progress"] < 0.9, "the jack is on its way")
        self.kill_planner()
        self.load(load)
        assert 0.05 < self.progress() < 0.95
        at = self.judge.true_pose("amr1")
        move = self.client.finish(self.start_leaving())
        assert move["fail_reason"] == MoveFailReason.JACK_IN_UP_STATE, move
        assert distance(self.judge.true_pose("amr1"), at.x, at.y) < 0.005, "it moved with a half-raised jack"

    # -- ground truth ------------------------------------------------------------------------------------------------

    def rack_is_at(self, place: tuple[float, float], within: float) -> None:
        true = self.judge.true_pose(RACK)
        assert distance(true, *place) <= within and abs(turn(true.yaw, UP)) <= math.radians(1.0), true

    def rack_is_on_the_jack(self) -> None:
        pose = self.client.order("GET", "/services/query_pose/rack_pose")["pose"]["pos"]
        true = self.judge.true_pose(RACK)
        assert math.dist(pose, (true.x, true.y)) < 0.05
        assert distance(true, *self.place()) < 0.05

    def place(self) -> tuple[float, float]:
        at = self.judge.true_pose("amr1")
        return at.x, at.y


def test_a_job_goes_on_after_the_planner_was_killed_in_each_of_its_stages(job: Job) -> None:
    client = job.client

    move = job.start_align()
    job.driven(0.5)
    job.kill_planner(move)  # on the way to the staging pose
    job.load("free")
    assert distance(job.judge.true_pose("amr1"), *FROM) > 1.0

    move = job.start_align()
    job.near(FROM, 0.9, "it crawls under the rack")
    job.kill_planner(move)
    assert 0.02 < distance(job.judge.true_pose("amr1"), *FROM) < 1.0
    job.succeed(job.start_align)
    job.load("under_rack")
    job.width(WIDTH)
    job.rack_is_at(FROM, within=0.005)

    client.service("jack_up")
    job.kill_planner_in_the_stroke("under_rack")
    job.rack_is_at(FROM, within=0.005)

    # The naive client posts the next move while the jack rises: it is held until the jack is up.
    client.service("jack_up")
    at = job.place()
    move = job.start_carrying()
    held = client.see(
        "/planning_state", lambda state: state["action_id"] == move and "message" in state, "the move is held"
    )
    assert held["move_state"] == "moving" and held["message"].startswith("the jack is moving up")
    client.see("/jack_state", lambda jack: jack["progress"] > 0.85, "the jack is nearly up")
    assert math.dist(job.place(), at) < 0.005, "it moved with a half-raised jack"

    job.driven(0.4)
    job.kill_planner(move)  # while it carries
    job.load("carrying")
    job.width(WITH_RACK)
    job.rack_is_on_the_jack()
    assert client.seen["/jack_state"]["weight"] > 60.0
    job.succeed(job.start_carrying)

    client.service("jack_down")
    job.kill_planner_in_the_stroke("carrying")
    client.jack("down")
    job.load("under_rack")
    job.width(WIDTH)
    job.rack_is_at(TO, within=0.03)

    move = job.start_leaving()
    job.driven(0.3)
    job.kill_planner(move)  # on the way out
    assert distance(job.judge.true_pose("amr1"), *TO) < 1.0
    job.succeed(job.start_leaving)
    job.load("free")
    assert math.dist(job.place(), ASIDE) < 0.1
    job.rack_is_at(TO, within=0.03)
    assert job.judge.inspect().contact_count == 0
