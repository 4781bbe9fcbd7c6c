"""Moves in rack areas in physics: which point is taken, and each reason to fail, raised by its cause."""

from __future__ import annotations

from pathlib import Path

import pytest

from rackhand.schemas.base import Pose2
from rackhand.schemas.fail_reasons import MoveFailReason as Reason
from rackhand.schemas.moves import Move
from rackhand.schemas.world import Place, Remove
from rackhand.services.planner.load import LoadState
from rackhand.worlds.world_model import RackKind
from tests.joined.chassis import JoinedChassis, Json
from tests.joined.racks import hall_with_racks, lift, rack_error, rack_point
from tests.joined.world import JoinedWorld
from tests.system.driving import wall

POINTS = {"a": (3.5, 2.2), "b": (3.5, 0.0), "c": (3.5, -2.2)}
UNLOAD = {"type": "to_unload_point", "rack_area_id": "area"}
ALIGN = {"type": "align_with_rack", "rack_area_id": "area"}


def area(x0: float = 2.5, y0: float = -3.5, x1: float = 4.5, y1: float = 3.5, **properties: object) -> Json:
    ring = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
    return {
        "type": "Feature",
        "id": "area",
        "geometry": {"type": "Polygon", "coordinates": [ring]},
        "properties": {"regionType": "17", "name": "north"} | properties,
    }


def patrol(*points: tuple[float, float]) -> Json:
    geometry = {"type": "LineString", "coordinates": [list(point) for point in points]}
    return {"type": "Feature", "id": "patrol", "geometry": geometry, "properties": {"lineType": 4}}


def begin(world: JoinedWorld, *more: Json) -> JoinedChassis:
    driver = world.chassis()
    driver.overlay(area(), *(rack_point(name, *place, 0.0) for name, place in POINTS.items()), *more)
    world.advance(0.4)
    return driver


def crate(driver: JoinedChassis, name: str, x: float, y: float, length: float = 0.4, width: float = 0.4) -> None:
    driver.world.ask(Place(name=name, pose=Pose2(x=x, y=y, yaw=0.0), size=(length, width, 0.6)))


def screen(driver: JoinedChassis, x: float, y: float, half: float) -> None:
    """Walls around a place that no beam passes, on no map."""
    for n, (dx, dy) in enumerate(((half, 0), (-half, 0), (0, half), (0, -half))):
        crate(driver, f"screen_{n}", x + dx, y + dy, 0.1 if dx else 2 * half, 2 * half if dx else 0.1)


def failed(move: Move, reason: Reason) -> str:
    assert (move.state, move.fail_reason) == ("failed", reason), move
    return move.fail_message


def hall(tmp_path: Path, **racks: tuple[str, float, float, float]) -> JoinedWorld:
    return JoinedWorld(hall_with_racks(**racks), tmp_path, seed=2, with_arms=False)


CARGO = ("standard", -1.0, 0.0, 0.0)


def at(name: str, x: float = 0.03, y: float = -0.02, kind: str = "standard") -> tuple[str, float, float, float]:
    """A rack at a point, a little off."""
    return kind, POINTS[name][0] + x, POINTS[name][1] + y, 0.03


# -- to_unload_point ---------------------------------------------------------------------------------------------------


def test_unload_takes_the_first_free_point_in_the_order_of_the_map(tmp_path: Path) -> None:
    with hall(tmp_path, cargo=CARGO, other=at("a")) as world:
        driver = begin(world)
        lift(driver, "cargo")
        assert driver.drive(UNLOAD).state == "succeeded"
        metres, degrees = rack_error(driver, "cargo", *POINTS["b"], 0.0)
        assert metres < 0.03 and degrees < 1.0
        assert world.inspect().contact_count == 0


def test_a_patrol_line_gives_the_order(tmp_path: Path) -> None:
    with hall(tmp_path, cargo=CARGO) as world:
        driver = begin(world, patrol((2.6, -3.0), (2.6, 3.0)))
        lift(driver, "cargo")
        assert driver.drive(UNLOAD).state == "succeeded"
        assert rack_error(driver, "cargo", *POINTS["c"], 0.0)[0] < 0.03


def test_a_full_area_is_512_and_with_a_place_free_again_the_next_job_works(tmp_path: Path) -> None:
    with hall(tmp_path, cargo=CARGO, other=at("a")) as world:
        driver = begin(world)
        crate(driver, "crate", *POINTS["b"])
        crate(driver, "box", *POINTS["c"])
        lift(driver, "cargo")
        text = failed(driver.drive(UNLOAD), Reason.NO_FREE_SPACE_IN_RACK_AREA)
        assert "all 3 rack points are occupied: a, b, c" in text
        world.ask(Remove(name="crate"))
        world.advance(3.0)
        assert driver.drive(UNLOAD).state == "succeeded"
        assert rack_error(driver, "cargo", *POINTS["b"], 0.0)[0] < 0.03


def test_points_that_cannot_be_seen_are_509(tmp_path: Path) -> None:
    with hall(tmp_path, cargo=CARGO, other=at("a")) as world:
        screen(world.chassis(), *POINTS["b"], 0.9)
        crate(world.chassis(), "box", *POINTS["c"])
        lift(world.chassis(), "cargo")
        driver = begin(world)
        text = failed(driver.drive(UNLOAD), Reason.UNKNOWN_RACK_SPACE_STATE)
        assert "of 1 of 3 rack points" in text and text.endswith(": b")


def test_a_free_point_that_cannot_be_reached_is_513(tmp_path: Path) -> None:
    with hall(tmp_path, cargo=CARGO, other=at("a")) as world:
        x, y = POINTS["b"]
        fence = wall((x - 0.8, y - 0.8), (x + 0.8, y - 0.8), (x + 0.8, y + 0.8), (x - 0.8, y + 0.8), (x - 0.8, y - 0.8))
        driver = begin(world, fence)
        crate(driver, "box", *POINTS["c"])
        lift(driver, "cargo")
        text = failed(driver.drive(UNLOAD), Reason.FAILED_TO_UNLOAD_IN_RACK_AREA)
        assert "b: unload_point_unreachable: calculation_failed" in text


# -- align_with_rack ---------------------------------------------------------------------------------------------------


def test_align_takes_the_first_point_that_holds_a_rack(tmp_path: Path) -> None:
    with hall(tmp_path, rack=at("b"), further=at("c")) as world:
        driver = begin(world)
        assert driver.drive(ALIGN).state == "succeeded"
        true, chassis = world.true_pose("rack"), world.true_pose("amr1")
        assert (chassis.x, chassis.y) == pytest.approx((true.x, true.y), abs=0.02)
        assert driver.core._motion.load.state is LoadState.UNDER_RACK
        assert world.inspect().contact_count == 0


def test_an_area_without_racks_is_510(tmp_path: Path) -> None:
    with hall(tmp_path) as world:
        text = failed(begin(world).drive(ALIGN), Reason.NO_RACK_IN_RACK_AREA)
        assert "all 3 rack points are free: a, b, c" in text


def test_racks_that_cannot_be_docked_to_are_511(tmp_path: Path) -> None:
    odd = hall_with_racks(rack=at("b"))
    kind = RackKind(size=(0.7, 0.7), underside=0.28, height=1.4, mass=60)
    world = odd.model_copy(update={"rack_kinds": {"standard": kind}})
    with JoinedWorld(world, tmp_path, seed=2, with_arms=False) as joined:
        text = failed(begin(joined).drive(ALIGN), Reason.ALIGN_FAILED_IN_RACK_AREA)
        assert "b: rack_detection_error: Wrong rack size" in text


def test_an_unknown_area_is_507_and_one_without_points_508(tmp_path: Path) -> None:
    with hall(tmp_path) as world:
        driver = begin(world)
        text = failed(driver.drive(ALIGN | {"rack_area_id": "nowhere"}), Reason.INVALID_RACK_AREA_ID)
        assert "'nowhere'" in text and "known: area" in text
        text = failed(driver.drive(ALIGN | {"properties": {"rack_layer": 1}}), Reason.INVALID_RACK_AREA)
        assert "with level 1" in text
        driver.overlay(area(), rack_point("outside", 0.0, 3.0))
        failed(driver.drive(ALIGN), Reason.INVALID_RACK_AREA)


def test_levels_of_area_and_points_are_heeded(tmp_path: Path) -> None:
    with hall(tmp_path, rack=at("b"), further=at("c")) as world:
        driver = begin(world)
        points = [rack_point(name, *place, 0.0) for name, place in POINTS.items()]
        points[1]["properties"]["enabledLevels"] = ["ground"]
        driver.overlay(area(rackLevels=[{"id": "ground", "height": 0}, {"id": "top", "height": 1.5}]), *points)
        assert driver.drive(ALIGN | {"properties": {"rack_layer": 1}}).state == "succeeded"
        assert driver.core._motion.load.rack_pose[1] == pytest.approx(POINTS["c"][1], abs=0.05), "b has no level 1"
