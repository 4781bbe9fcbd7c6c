"""Poses of the tool for a pick: in the frame of the arm's base, with the rack where it is seen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.demo import JAR_OFF
from rackhand.schemas import planar
from rackhand.services.launch.demo import stage
from rackhand.services.launch.demo.errors import StoryError
from rackhand.services.launch.demo.picking import ACROSS, ALONG, CUP, LIFT, OUTSIDE, Base, Goods
from rackhand.services.launch.demo.story import ITEMS, RACK
from rackhand.services.planner.geometry import se2
from rackhand.services.planner.geometry.footprint import expanded
from rackhand.services.planner.geometry.polygon import convex_overlap
from rackhand.worlds.world_model import Item, World, load_world

JAR = Goods("jar", at=(-0.15, -0.33, 0.975), height=0.12, target=(1.0, 2.0), table=0.7)
TURNED = (16.6, 12.2, math.pi / 2)
APART = 0.02  # m between jars, which are off their places by nearly the same


def test_the_tool_is_given_in_the_frame_of_the_base_a_cup_above_the_point() -> None:
    pose = Base((1.0, 2.0, math.pi / 2), height=0.6).tool((1.0, 2.5, 1.0), heading=math.pi / 2)
    assert pose["Position"] == pytest.approx([0.5, 0.0, 0.4 + CUP])
    rows = [value for row in pose["Orientation"]["Matrix"].values() for value in row]
    assert rows == pytest.approx([1, 0, 0, 0, -1, 0, 0, 0, -1])


def test_the_lid_is_where_the_rack_is_seen_not_where_it_should_be() -> None:
    assert JAR.lid(TURNED) == pytest.approx((16.93, 12.05, 0.975))
    assert JAR.lid((16.62, 12.2, math.pi / 2)) == pytest.approx((16.95, 12.05, 0.975))


def test_the_tool_goes_in_from_the_side_of_the_item() -> None:
    assert JAR.before_shelf(TURNED) == pytest.approx((16.6 + OUTSIDE, 12.05, 0.975 + LIFT))
    other_side = Goods("jar", (-0.15, 0.33, 0.975), 0.12, (0, 0), 0.7)
    assert other_side.before_shelf(TURNED) == pytest.approx((16.6 - OUTSIDE, 12.05, 0.975 + LIFT))


def test_the_cup_over_the_table_is_as_high_as_what_it_carries() -> None:
    assert JAR.over_target(0.01) == pytest.approx((1.0, 2.0, 0.83))


def test_the_inventory_is_that_of_the_world() -> None:
    world = load_world("warehouse")
    goods = stage.scene_of(world).goods
    assert tuple(goods) == ITEMS
    for name, item in goods.items():
        x, y, z = item.lid(world.racks[RACK].pose)
        assert (x, y) == pytest.approx(world.items[name].pose[:2])
        assert z == pytest.approx(0.855 + 0.12)


def test_a_jar_that_is_off_its_place_as_far_as_it_may_be_comes_down_on_nothing() -> None:
    """What lies on the table may be touched by a jar on its way down, and then the arm's contact watch stops it."""
    world = load_world("warehouse")
    surfaces, lying = world.surfaces(), [item for item in world.items.values() if item.lies_on == stage.TABLE]
    jars = {name: footprint(world.items[name], on_the_table(world, name)) for name in ITEMS}
    for name, jar in jars.items():
        reached = expanded(jar, JAR_OFF)
        touched = [item.pose for item in lying if convex_overlap(reached, footprint(item, item.pose))]
        assert touched == [], f"{name} could touch what lies at {touched}"
        alike = expanded(jar, APART)
        touched = [other for other in ITEMS if other != name and convex_overlap(alike, jars[other])]
        assert touched == [], f"{name} could touch {touched}"
        x, y = stage.TARGETS[name]
        middles = [(x + i * JAR_OFF, y + j * JAR_OFF) for i in (-1, 1) for j in (-1, 1)]
        assert all(surfaces[stage.TABLE].is_under(*middle) for middle in middles), f"{name} could tip over the edge"


def on_the_table(world: World, name: str) -> planar.PlanarPose:
    """A jar as it is to stand on the table: turned with the rack, and with the cup from shelf to table."""
    presented, stored = world.racks[stage.SET_ASIDE].pose[2], world.racks[RACK].pose[2]
    return *stage.TARGETS[name], world.items[name].pose[2] - stored + presented + ALONG - ACROSS


def footprint(item: Item, pose: planar.PoseLike) -> NDArray[np.float64]:
    """Its corners (4, 2) on the map, counter-clockwise."""
    length, width, _ = item.size
    corners = np.array([(length, width), (-length, width), (-length, -width), (length, -width)]) / 2
    return se2.transformed(np.array(pose), corners)


def test_a_world_without_the_rack_or_the_arm_is_refused_by_name() -> None:
    with pytest.raises(StoryError, match="jar_1"):
        stage.scene_of(load_world("empty"))
    with pytest.raises(StoryError, match="no arm arm1"):
        stage.scene_of(load_world("warehouse").model_copy(update={"arms": {}}))
