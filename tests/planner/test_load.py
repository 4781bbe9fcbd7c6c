"""The load state: what changes it, what derives from it, and that it survives the process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import Contacts, Jack
from rackhand.schemas.racks import RackSpec
from rackhand.services.planner.geometry.footprint import Footprint
from rackhand.services.planner.load import Load, LoadState, Measured, next_load
from rackhand.services.planner.perception.chassis_state import ChassisState
from tests.planner.fakes import Cell
from tests.planner.plant import BODY

RACK = RackSpec(width=0.8, depth=0.73)  # 0.83 x 0.9 m with its margins


def measured(
    progress: float = 0.0, weight: float = 0.0, pose: Any = (2.0, 3.0, 1.57), charge_contact: bool = False
) -> Measured:
    state = ChassisState()
    state.take(Jack(stamp=0, state="hold", progress=progress, weight=weight))
    state.take(Contacts(stamp=0, charge_contact=charge_contact))
    return Measured(state, None if pose is None else np.array(pose), Footprint.of(BODY))


def test_a_rack_is_lifted_carried_put_down_and_left() -> None:
    load = Load()
    assert next_load(load, measured(1.0, 0.4), RACK) is load, "the jack is up with nothing on it"
    load = next_load(load, measured(1.0, 90.0), RACK)
    assert load.state is LoadState.CARRYING
    assert next_load(load, measured(0.5, 90.0), RACK) is load, "it is still on its way down"
    load = next_load(load, measured(0.0, 0.0), RACK)
    assert load.state is LoadState.UNDER_RACK
    assert np.mean(load.rack, axis=0) == pytest.approx([2.0, 3.0])
    assert next_load(load, measured(pose=(2.0, 3.5, 1.57)), RACK) is load, "half of it is still above the chassis"
    assert next_load(load, measured(pose=None), RACK) is load
    assert next_load(load, measured(pose=(2.0, 4.0, 1.57)), RACK) == Load()


def test_a_rack_that_is_lifted_again_keeps_its_outline() -> None:
    spec = RackSpec(width=0.9, depth=1.2)
    carried = Load(state=LoadState.CARRYING, spec=spec, rack_pose=(0.05, 0.0, 0.02))
    down = next_load(carried, measured(0.0), RACK)
    up = next_load(down, measured(1.0, 90.0), RACK)
    assert up.spec == spec and up.rack_pose == pytest.approx(carried.rack_pose)


def test_the_charger_s_contacts_dock_it() -> None:
    load = next_load(Load(), measured(charge_contact=True), RACK)
    assert load.state is LoadState.DOCKED
    assert next_load(load, measured(charge_contact=True), RACK) is load
    assert next_load(load, measured(), RACK) == Load()


def test_the_footprint_holds_body_and_rack() -> None:
    body = Footprint.of(BODY)
    assert Load.under(RACK, np.array([9.0, 9.0, 0.0])).footprint(body) is body
    carrying = Load(state=LoadState.CARRYING, spec=RACK, rack_pose=(0.0, 0.0, 0.0)).footprint(body)
    assert carrying.polygon[:, 0].max() == pytest.approx(0.415) and carrying.polygon[:, 1].max() == pytest.approx(0.45)
    short = RackSpec(width=0.8, depth=0.4)
    long = Load(state=LoadState.CARRYING, spec=short, rack_pose=(0.0, 0.0, 0.0)).footprint(body)
    assert long.polygon[:, 0].max() == pytest.approx(0.375), "the body sticks out"


def test_footprint_and_load_are_published_once_and_when_they_change(make_cell: Callable[..., Cell]) -> None:
    cell = make_cell(jack=Jack(stamp=0, state="hold", progress=0.0, weight=0.0))
    cell.tick(3)
    (empty,) = cell.heard(topics.FOOTPRINT)
    assert np.ptp(empty.outline, axis=0) == pytest.approx([0.75, 0.46])
    assert [load.state for load in cell.heard(topics.LOAD)] == ["free"]
    cell.jack = Jack(stamp=0, state="hold", progress=1.0, weight=90.0)
    cell.tick(3)
    outline = cell.heard(topics.FOOTPRINT)[1].outline
    assert np.ptp(outline, axis=0) == pytest.approx([1.3, 1.0]), (
        "the largest rack with its margins, as none was measured"
    )
    load = cell.heard(topics.LOAD)[-1]
    assert load.state == "carrying" and (load.spec.width, load.spec.depth) == (0.9, 1.2)
    assert load.rack_pose == Pose2(x=0.0, y=0.0, yaw=0.0)
    cell.jack = Jack(stamp=0, state="hold", progress=0.0, weight=0.0)
    cell.tick(3)
    assert np.ptp(cell.heard(topics.FOOTPRINT)[2].outline, axis=0) == pytest.approx([0.75, 0.46])
    assert [load.state for load in cell.heard(topics.LOAD)] == ["free", "carrying", "under_rack"]
    assert len(cell.heard(topics.FOOTPRINT)) == 3


def test_it_survives_a_restart_and_the_footprint_with_it(make_cell: Callable[..., Cell], tmp_path: Path) -> None:
    path = tmp_path / "kept.sqlite"
    first = make_cell(path=path, jack=Jack(stamp=0, state="hold", progress=1.0, weight=90.0))
    first.tick(2)
    carrying = first.motion.footprint
    assert carrying is not None and carrying.inscribed > 0.4
    first.database.close()
    second = make_cell(path=path)  # whose jack has not been measured yet
    second.tick(2)
    again = second.motion.footprint
    assert again is not None and np.array_equal(again.polygon, carrying.polygon)
    second.jack = Jack(stamp=0, state="hold", progress=0.0, weight=0.0)
    second.tick()
    assert second.motion.footprint is not None and second.motion.footprint.inscribed == pytest.approx(0.23)
