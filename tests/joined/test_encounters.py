"""Three of the encounters of ``benchmarks/encounters.py``: no contact, no failure, little time lost."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest

from benchmarks.encounters import DRIVEN_INTO, GOAL, START, Seen, closing_speed, encounter_of, meet, stops
from rackhand.schemas.base import Pose2

ALONE = {"open": 16.8, "corridor": 16.8}  # s; what the benchmark measures first
MOST_LOST = 20.0  # s


@pytest.mark.parametrize("number", [0, 5, 7])
def test_nobody_is_touched_and_the_goal_is_reached(number: int) -> None:
    encounter = encounter_of(number)
    outcome = meet(encounter, ALONE[encounter.ground])
    assert (outcome.state, outcome.contacts) == ("succeeded", 0)
    assert 0.1 < outcome.nearest < 3.0, "the person must come near, or nothing is tested"
    assert -1.0 < outcome.lost < MOST_LOST


def test_an_encounter_is_always_the_same_and_every_kind_meets_on_every_ground() -> None:
    made = [encounter_of(k) for k in range(200)]
    assert made == [encounter_of(k) for k in range(200)]
    assert len({(e.ground, e.kind) for e in made}) == 8
    assert all(0.4 <= e.speed <= 1.4 and e.delay >= 0.0 for e in made)
    assert len({e.speed for e in made}) > 50


def drive(xs: Sequence[float], person: tuple[float, float] = (0.0, 3.0)) -> list[Seen]:
    there = Pose2(x=person[0], y=person[1], yaw=0.0)
    return [Seen(0.1 * k, Pose2(x=x, y=0.0, yaw=0.0), there) for k, x in enumerate(xs)]


@pytest.mark.parametrize(
    ("robot", "person", "gap"),
    [
        ((0.0, 0.0, 0.0), (0.375 + 0.55, 0.0), 0.3),
        ((0.0, 0.0, 0.0), (0.1, -0.23 - 0.45), 0.2),
        ((0.0, 0.0, 0.0), (0.375 + 0.3, 0.23 + 0.4), 0.25),
        ((0.0, 0.0, 0.0), (-0.375 - 0.06, -0.23 - 0.08), -0.15),
        ((0.0, 0.0, 0.0), (0.0, 0.0), -0.25),
        ((1.0, -2.0, math.pi / 2), (1.0 - 0.23 - 0.4, -2.0 + 0.375 + 0.3), 0.25),
        ((-0.781, -0.026, 0.199), (-0.266, 0.558), 0.0936),
    ],
)
def test_the_gap_is_the_euclidean_one_beyond_a_corner_too(
    robot: tuple[float, float, float], person: tuple[float, float], gap: float
) -> None:
    seen = Seen(0.0, Pose2(x=robot[0], y=robot[1], yaw=robot[2]), Pose2(x=person[0], y=person[1], yaw=0.0))
    assert seen.gap == pytest.approx(gap, abs=1e-3)


def test_a_stop_is_counted_between_the_first_motion_and_the_arrival() -> None:
    moving = [START + 0.1 * k for k in range(20)]
    standing = [moving[-1]] * 5
    onwards = [moving[-1] + 0.1 * k for k in range(1, 20)]
    assert stops(drive([START] * 9 + moving)) == 0
    assert stops(drive(moving + standing + onwards)) == 1
    assert stops(drive(moving + standing[:2] + onwards)) == 0, "too short to be a stop"
    assert stops(drive([*moving, *onwards, *[GOAL - 0.1] * 9, GOAL])) == 0, "it arrives there"


def test_a_contact_is_the_robots_if_it_drives_towards_the_person() -> None:
    ahead = drive([0.0, 0.1, 0.2], person=(0.8, 0.0))
    assert closing_speed(ahead, 0.15) == pytest.approx(1.0)
    assert closing_speed(drive([0.0, 0.0, 0.0], person=(0.8, 0.0)), 0.15) < DRIVEN_INTO
    assert closing_speed(drive([0.0, 0.1, 0.2], person=(-0.8, 0.0)), 0.15) < 0.0, "it drives away"
