"""Poses of the tool for a pick: in the frame of the arm's base, with the rack where it is seen."""

from __future__ import annotations

import math

import pytest

from rackhand.services.launch.demo import stage
from rackhand.services.launch.demo.errors import StoryError
from rackhand.services.launch.demo.picking import CUP, LIFT, OUTSIDE, Base, Goods
from rackhand.services.launch.demo.story import ITEMS, RACK
from rackhand.worlds.world_model import load_world

JAR = Goods("jar", at=(-0.15, -0.33, 0.975), height=0.12, target=(1.0, 2.0), table=0.7)
TURNED = (16.6, 12.2, math.pi / 2)


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
    targets = [item.target for item in goods.values()]
    for i, one in enumerate(targets):
        assert all(math.dist(one, other) > 0.142 for other in targets[:i]), "jars turned anyhow would touch"


def test_a_world_without_the_rack_or_the_arm_is_refused_by_name() -> None:
    with pytest.raises(StoryError, match="jar_1"):
        stage.scene_of(load_world("empty"))
    with pytest.raises(StoryError, match="no arm arm1"):
        stage.scene_of(load_world("warehouse").model_copy(update={"arms": {}}))
