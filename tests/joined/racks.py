"""Racks in a joined world: put the chassis under one and lift it, as align_with_rack and jack_up would."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from rackhand.schemas import planar
from rackhand.schemas.base import Pose2
from rackhand.schemas.chassis import JackRequest
from rackhand.schemas.fail_reasons import MoveFailReason
from rackhand.schemas.moves import Move
from rackhand.schemas.racks import RackSpec
from rackhand.schemas.world import MoveRobot
from rackhand.services.planner.load import Load, LoadState
from rackhand.testing import distance, turn
from rackhand.worlds.world_model import Rack, World, load_world
from tests.joined.chassis import JoinedChassis, Json

SPECS = {"standard": RackSpec(width=0.83, depth=0.83), "large": RackSpec(width=0.9, depth=1.2, leg_size=0.04)}
Cause = Callable[[JoinedChassis], Move]
STROKE = 14.0  # s that a stroke of the jack takes at most


def hall_with_racks(**racks: tuple[str, float, float, float]) -> World:
    """The empty hall with racks: name = kind, x, y, yaw."""
    kinds = load_world("warehouse").rack_kinds
    placed = {name: Rack(kind=kind, pose=pose) for name, (kind, *pose) in racks.items()}
    return load_world("empty").model_copy(update={"rack_kinds": kinds, "racks": placed})


def rack_point(name: str, x: float, y: float, degrees: float | None = 0.0) -> Json:
    """The overlay of a rack point; its id is ``id_<name>``."""
    properties = {"type": "34", "name": name} | ({} if degrees is None else {"yaw": degrees})
    geometry = {"type": "Point", "coordinates": [x, y]}
    return {"type": "Feature", "id": f"id_{name}", "geometry": geometry, "properties": properties}


def put_under(driver: JoinedChassis, rack: str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
    """Set the chassis down under a rack, its pose off the rack's by ``offset`` (rack frame), and let it know."""
    world = driver.world
    true = world.true_pose(rack)
    x, y, yaw = planar.compose((true.x, true.y, true.yaw), offset)
    world.ask(MoveRobot(robot=driver.name, pose=Pose2(x=x, y=y, yaw=yaw)))
    world.advance(0.4)
    motion = driver.core._motion
    motion._take_load(Load.under(SPECS[kind_of(driver, rack)], np.array([true.x, true.y, true.yaw])))
    motion.load_changed = True


def lift(driver: JoinedChassis, rack: str, offset: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
    """Put the chassis under a rack and raise the jack."""
    put_under(driver, rack, offset)
    driver.ask(JackRequest(direction="up"))
    driver.world.advance(STROKE)
    assert driver.core._motion.load.state is LoadState.CARRYING


def lower(driver: JoinedChassis) -> None:
    driver.ask(JackRequest(direction="down"))
    driver.world.advance(STROKE)
    assert driver.core._motion.load.state is LoadState.UNDER_RACK


def with_jack_up(driver: JoinedChassis, body: Json) -> Move:
    """That move, asked for with the jack raised."""
    driver.ask(JackRequest(direction="up"))
    driver.world.advance(STROKE)
    return driver.drive(body)


def check_failure(driver: JoinedChassis, cause: Cause, reason: MoveFailReason, text: str) -> None:
    """The move that ``cause`` drives fails for that reason, with that text, and nothing was touched."""
    move = cause(driver)
    assert (move.state, move.fail_reason) == ("failed", reason), move
    assert text in move.fail_message, move.fail_message
    assert driver.world.inspect().contact_count == 0


def kind_of(driver: JoinedChassis, rack: str) -> str:
    return driver.world.simulation.world.racks[rack].kind


def rack_error(driver: JoinedChassis, rack: str, x: float, y: float, yaw: float) -> tuple[float, float]:
    """How far a rack truly is from a pose: metres and degrees."""
    true = driver.world.true_pose(rack)
    return distance(true, x, y), math.degrees(turn(true.yaw, yaw))


def unload(
    x: float | None = None, y: float | None = None, ori: float | None = None, **more: object
) -> dict[str, object]:
    """The body of a move that puts the rack down there."""
    target = {"target_x": x, "target_y": y, "target_ori": ori}
    return {"creator": "test", "type": "to_unload_point"} | {k: v for k, v in target.items() if v is not None} | more
