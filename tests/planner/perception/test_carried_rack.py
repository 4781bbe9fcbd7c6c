"""A rack on the jack, measured by its legs: where it is after lifting, and when it has moved."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest

from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.load import Load, LoadState, Slip
from rackhand.services.planner.perception.carried_rack import CarriedRack, Moved, objects_under
from rackhand.services.planner.perception.seen_scan import SeenScan
from rackhand.services.planner.settings import NavigationSettings
from tests.planner.plant import BODY, box
from tests.planner.racks import LARGE, SENSOR, SPECS, STANDARD, legs, look

SETTINGS = NavigationSettings(rack_specs=SPECS)
PLACE = np.array([6.0, 6.0, 0.4])
LIFTED = (0.01, -0.02, 0.03)
SCAN = 80_000_000


class Carrier:
    """A chassis with a rack on its jack, a scan at a time."""

    def __init__(self, spec: RackSpec = STANDARD, believed: RackSpec | None = None) -> None:
        self.spec, self.watch, self.scans = spec, CarriedRack(), 0
        self.load = Load(state=LoadState.CARRYING, spec=believed or spec, rack_pose=(0.0, 0.0, 0.0))
        self.moved: list[Moved] = []

    def scan(self, rack: Sequence[float], things: Sequence[np.ndarray] = ()) -> SeenScan:
        self.scans += 1
        there = se2.compose(PLACE, np.array(rack))
        points = look([*legs(self.spec, there), *things], self.scans, PLACE)
        return SeenScan(self.scans * SCAN, points, PLACE, np.zeros(3), SENSOR)

    def see(self, rack: Sequence[float], seconds: float = 2.0) -> Load:
        for _ in range(round(seconds * 1e9 / SCAN)):
            self.load, moved = self.watch.look(self.load, self.scan(rack), SETTINGS)
            self.moved += [moved] if moved else []
        return self.load


@pytest.mark.parametrize("spec", SPECS, ids=("standard", "large"))
def test_after_lifting_the_rack_is_where_its_legs_are(spec: RackSpec) -> None:
    load = Carrier(spec).see(LIFTED)
    assert load.rack_pose == load.lifted_pose == pytest.approx(LIFTED, abs=0.006)
    assert load.slipped is Slip.NONE


def test_a_rack_that_was_lifted_unmeasured_gets_the_kind_that_fits() -> None:
    unmeasured = RackSpec(width=0.9, depth=1.2)
    assert Carrier(STANDARD, believed=unmeasured).see(LIFTED).spec == STANDARD
    assert Carrier(LARGE, believed=unmeasured).see(LIFTED).spec == LARGE


def test_noise_and_small_movements_change_nothing() -> None:
    carrier = Carrier()
    before = carrier.see(LIFTED)
    assert carrier.see((LIFTED[0] + 0.015, LIFTED[1], LIFTED[2] + 0.01), 8.0) is before


@pytest.mark.parametrize("shift", [(0.042, 0.0, 0.0), (0.0, 0.0, math.radians(3.0))], ids=("moved", "turned"))
def test_a_slight_movement_is_noted_within_a_second_and_its_pose_taken(shift: Sequence[float]) -> None:
    carrier = Carrier()
    before, now = carrier.see(LIFTED), se2.compose(np.array(LIFTED), np.array(shift))
    after = carrier.see(now, 0.95)
    assert after.slipped is Slip.SLIGHTLY and carrier.moved == []
    assert after.rack_pose == pytest.approx(tuple(now), abs=0.012)
    assert after.lifted_pose == before.lifted_pose, "what comes on top of it counts from there"
    further = carrier.see(se2.compose(now, np.array(shift)), 0.95)
    assert further.slipped is Slip.SIGNIFICANTLY and len(carrier.moved) == 1


@pytest.mark.parametrize("shift", [(0.0, 0.08, 0.0), (0.0, 0.0, -math.radians(6.0))], ids=("moved", "turned"))
def test_a_far_movement_is_told_once_with_figures_and_counts_from_there(shift: Sequence[float]) -> None:
    carrier = Carrier()
    carrier.see(LIFTED)
    now = se2.compose(np.array(LIFTED), np.array(shift))
    load = carrier.see(now, 0.95)
    ((text, measures),) = carrier.moved
    assert any(one.expected is not None and one.value > one.expected for one in measures)
    assert "0.06 m" in text and "4 degrees" in text
    assert load.rack_pose == load.lifted_pose == pytest.approx(tuple(now), abs=0.012)
    assert carrier.see(now, 4.0).slipped is Slip.SIGNIFICANTLY and len(carrier.moved) == 1


def test_only_a_carried_rack_is_measured() -> None:
    carrier = Carrier()
    under = Load.under(STANDARD, PLACE)
    assert carrier.watch.look(under, carrier.scan(LIFTED), SETTINGS).load is under


def test_what_is_under_the_rack_is_neither_leg_nor_body() -> None:
    carrier, body = Carrier(), Footprint.of(BODY)
    carrier.see(LIFTED)
    assert len(objects_under(carrier.load, carrier.scan(LIFTED), body)) == 0
    thing = box(*se2.transformed(PLACE, np.array([[0.0, 0.32]]))[0], 0.1, 0.05, PLACE[2])
    found = objects_under(carrier.load, carrier.scan(LIFTED, [thing]), body)
    assert len(found) >= 3 and (np.hypot(*(found - (0.0, 0.32)).T) < 0.1).all()
