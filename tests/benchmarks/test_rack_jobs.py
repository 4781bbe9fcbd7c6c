"""What the benchmark of rack jobs counts as a forbidden contact, and how it tells failures."""

from __future__ import annotations

from benchmarks.rack_jobs import Job, forbidden, report
from rackhand.schemas.world import Touch
from rackhand.worlds.world_model import load_world

WORLD = load_world("warehouse")
ALLOWED = (
    ("amr1/jack", "rack_s5"),
    ("amr1/wheels", "floor"),
    ("floor", "rack_s5"),
    ("carton_s5_1", "rack_s5"),
    ("parcel_red", "tote_table"),
)


def touch(*parts: str) -> Touch:
    return Touch(parts=parts, first=1, last=2)


def test_contacts_of_carrying_are_allowed_and_no_others() -> None:
    assert forbidden([touch(*pair) for pair in ALLOWED], WORLD) == []
    for pair in (
        ("amr1/hull", "rack_s5"),
        ("amr1/wheels", "rack_s5"),
        ("rack_s5", "rack_s6"),
        ("rack_s5", "wall_middle"),
        ("carton_s5_1", "floor"),
        ("amr1/jack", "floor"),
    ):
        assert forbidden([touch(*pair)], WORLD) == ["–".join(pair)]


def test_the_report_counts_what_failed_and_says_why() -> None:
    good = Job("point to area", "large", 0, align=10.0, unload=20.0, whole=60.0, away=0.004, turned=0.2)
    bad = Job("point to area", "large", 1, trouble="to_unload_point: 503")
    told = report([good, bad])
    row = next(row for row in told.rows if row[:2] == ("point to area", "large"))
    assert row == ("point to area", "large", "1 of 2", "4.0 / 4.0", "0.20 / 0.20", "10.0", "20.0", "60.0")
    assert "1 of 2 succeeded" in told.remarks and "point to area, large, seed 1: to_unload_point: 503" in told.remarks
