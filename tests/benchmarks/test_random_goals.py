"""What the benchmark of random goals counts: contacts of a robot that moved, and goals to which there is a way."""

from __future__ import annotations

from pathlib import Path

from benchmarks.random_goals import Part, is_robots, read, report, there_is_a_way
from rackhand.schemas.world import Contact

CHARGER, STORAGE, PICKING = (2.5, 1.5), (5.5, 7.7), (14.0, 7.0)
# Across the hall, from the south wall to the north one, each closer to the next than a robot is wide.
ROW = {f"crate_{k}": (9.4, 0.4 + 0.7 * k) for k in range(20)}


def test_there_is_a_way_unless_things_are_across_it() -> None:
    assert there_is_a_way(CHARGER, STORAGE, {})
    assert there_is_a_way(CHARGER, PICKING, {})
    assert not there_is_a_way(CHARGER, PICKING, ROW)
    assert there_is_a_way(CHARGER, STORAGE, ROW), "both are on this side of the row"


def test_there_is_no_way_into_a_thing_and_one_out_of_a_narrow_place() -> None:
    assert not there_is_a_way(CHARGER, PICKING, {"rack": PICKING})
    assert there_is_a_way((CHARGER[0] + 0.4, CHARGER[1]), STORAGE, {"crate_0": CHARGER})


def test_a_contact_is_the_robots_if_it_moved_just_before() -> None:
    contact = Contact(stamp=2_000_000_000, robot="amr1", other="anna", force=10.0)
    assert is_robots(contact, {1_960_000_000: (0.3, 0.0)})
    assert is_robots(contact, {1_960_000_000: (0.0, -0.3)}), "turning, too"
    assert not is_robots(contact, {1_960_000_000: (0.01, 0.0)})
    assert not is_robots(contact, {1_500_000_000: (0.3, 0.0), 1_960_000_000: (0.0, 0.0)}), "it stopped before"
    assert not is_robots(contact, {2_040_000_000: (0.3, 0.0)}), "it was pushed"


def test_a_run_goes_on_from_its_file_and_the_report_names_each_fault(tmp_path: Path) -> None:
    assert read(tmp_path / "none.jsonl") == {}
    part = Part(3, 600.0, {"cancelled": 50, "succeeded": 9}, ["rack_s1 at 3.0 s, 9 N"], [], ["(1, 2) to (3, 4): why"])
    text = report([part]).markdown()
    assert "| 0.17 | 59 | 1 | 0 | 1 | 50 cancelled, 9 succeeded |" in text
    assert "rack_s1 at 3.0 s, 9 N; (1, 2) to (3, 4): why" in text
