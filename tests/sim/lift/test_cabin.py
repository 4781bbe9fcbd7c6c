"""A lift in physics: its doors, its light curtain, a ride with what is in the cabin, and its faults."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rackhand.schemas import topics
from rackhand.schemas.base import Pose2
from rackhand.schemas.lift import CallLift, GoToFloor, HoldDoor, LiftRequest, LiftState, ReleaseLift
from rackhand.schemas.refusal import RequestRefused
from rackhand.schemas.world import InjectFault, MoveRobot, Place
from rackhand.services.sim.simulation import Simulation
from tests.sim.helpers import coast, drive, make_simulation, make_world, newest

WALLS = {
    f"wall_{n}_{side}": {"kind": "wall", "start": (x0 + dx, y0), "end": (x0 + dx, y1), "thickness": 0.1}
    for n, (x0, y0, y1) in enumerate(((1.2, -1.5, -0.7), (1.2, 0.7, 1.5)))
    for side, dx in (("down", 0), ("up", 20))
}


def hall(**lift: Any) -> Simulation:
    """A lift whose cabin is about the origin and opens to +x; upstairs is 20 m further. The chassis is before it."""
    kind = {"floors": {"floor1": (0, 0, 0), "floor2": (20, 0, 0)}, "cabin": (2.3, 2.6), "door": 1.4, "door_at": 1.2}
    return make_simulation(
        make_world(
            floors={"floor2": {"bounds": (15, -10, 35, 10)}},
            lifts={"lift_1": kind | lift},
            statics=WALLS,
            robots={"amr1": {"profile": "longjack", "pose": (3.0, 0, 0)}},
        )
    )


def ask(simulation: Simulation, request: Any) -> LiftState:
    return simulation.lifts["lift_1"].handle(LiftRequest(request=request), simulation.stamp)


def state(simulation: Simulation) -> LiftState:
    return simulation.lifts["lift_1"].state(simulation.stamp)


def until(simulation: Simulation, within: float = 30.0, **wanted: Any) -> float:
    """Let time pass until the lift is so; the seconds that it took."""
    begun = simulation.stamp
    while any(getattr(state(simulation), name) != value for name, value in wanted.items()):
        assert simulation.stamp < begun + within * 1e9, f"{state(simulation)} is not {wanted}"
        drive(simulation, 0.02)
    return (simulation.stamp - begun) * 1e-9


def leaf(simulation: Simulation, name: str) -> float:
    """How far (m) a leaf is open."""
    return float(simulation.data.joint(f"lift_1/{name}").qpos[0])


def put(simulation: Simulation, x: float, y: float = 0.0, yaw: float = 0.0) -> None:
    simulation.change(MoveRobot(robot="amr1", pose=Pose2(x=x, y=y, yaw=yaw)))


def test_doors_open_at_the_floor_of_the_cabin_only_and_close_again() -> None:
    simulation = hall()
    ask(simulation, CallLift(client="amr1", floor="floor1"))
    assert until(simulation, door="open") == pytest.approx(3.0, abs=0.3)
    here = [leaf(simulation, f"floor1/{name}") for name in ("shaft_left", "shaft_right", "cabin_left", "cabin_right")]
    assert here == pytest.approx([0.7] * 4, abs=0.01)
    assert leaf(simulation, "floor2/shaft_left") == pytest.approx(0.0, abs=1e-3)
    until(simulation, door="closed")
    assert leaf(simulation, "floor1/cabin_right") == pytest.approx(0.0, abs=0.01)


def test_the_lidar_sees_the_doors_move() -> None:
    simulation = hall()
    put(simulation, 3.0)

    def ahead() -> float:
        drive(simulation, 0.08)
        while (scan := newest(simulation, topics.SCAN)) is None:
            drive(simulation, 0.02)
        return float(scan.ranges[0])  # of the beam backwards

    shut = ahead()
    assert shut == pytest.approx(3.0 + 0.2 - 1.2 - 0.025, abs=0.01)
    ask(simulation, CallLift(client="amr1", floor="floor1"))
    until(simulation, door="open")
    assert np.isnan(through := ahead()) or through > shut + 0.5


def test_a_ride_takes_the_chassis_to_the_other_floor_and_nothing_else() -> None:
    simulation = hall()
    put(simulation, 0.1, -0.2, 0.5)
    simulation.change(Place(name="crate", pose=Pose2(x=-0.7, y=0.8, yaw=0.3)))
    simulation.change(Place(name="outside", pose=Pose2(x=4.0, y=3.0, yaw=0.0)))
    ask(simulation, CallLift(client="amr1", floor="floor1"))
    until(simulation, door="open")
    before = newest_odometry(simulation)
    ask(simulation, GoToFloor(client="amr1", floor="floor2"))
    assert until(simulation, moving=True) == pytest.approx(3.0, abs=0.4)
    assert simulation.robots["amr1"].pose == pytest.approx((0.1, -0.2, 0.5), abs=0.005)
    assert until(simulation, moving=False) == pytest.approx(8.0, abs=0.1)
    assert simulation.robots["amr1"].pose == pytest.approx((20.1, -0.2, 0.5), abs=0.005)
    until(simulation, floor="floor2", door="open")
    places = {thing.name: thing.position[:2] for thing in simulation.objects().objects}
    assert places["crate"] == pytest.approx((19.3, 0.8)) and places["outside"] == pytest.approx((4.0, 3.0))
    after = newest_odometry(simulation)
    assert (after.x, after.y, after.yaw) == pytest.approx((before.x, before.y, before.yaw), abs=0.005)
    drive(simulation, 3.0, linear=0.6)
    assert simulation.robots["amr1"].pose[0] > 21.4 and simulation.contact_log.count == 0


def newest_odometry(simulation: Simulation) -> Any:
    coast(simulation, 0.02)
    return newest(simulation, topics.ODOMETRY).pose


@pytest.mark.parametrize("x", [1.15, 0.75, 1.55])
def test_doors_do_not_close_on_a_chassis_between_them(x: float) -> None:
    """In the middle, with its back, and with its front."""
    simulation = hall()
    ask(simulation, CallLift(client="amr1", floor="floor1"))
    until(simulation, door="open")
    put(simulation, x)
    ask(simulation, GoToFloor(client="amr1", floor="floor2"))
    drive(simulation, 15.0)
    assert state(simulation).blocked and state(simulation).opening > 0.95
    assert simulation.contact_log.count == 0
    put(simulation, 0.0)
    until(simulation, floor="floor2", door="open")
    assert simulation.contact_log.count == 0


def test_doors_open_again_for_one_that_comes_while_they_close() -> None:
    simulation = hall()
    ask(simulation, CallLift(client="amr1", floor="floor1"))
    until(simulation, door="open")
    until(simulation, door="closing")
    drive(simulation, 1.0)
    put(simulation, 1.15)
    drive(simulation, 0.5)
    assert state(simulation).door in ("opening", "open") and simulation.contact_log.count == 0


def test_the_fault_closes_the_doors_on_the_chassis_but_does_not_crush_it() -> None:
    simulation = hall()
    ask(simulation, CallLift(client="amr1", floor="floor1"))
    until(simulation, door="open")
    put(simulation, 1.15)
    simulation.change(InjectFault(target="lift_1", fault="lift_door_closes"))
    drive(simulation, 4.0)
    assert {contact.other for contact in simulation.contact_log.rows} == {"lift_1"}
    assert simulation.robots["amr1"].pose == pytest.approx((1.15, 0.0, 0.0), abs=0.02)
    assert state(simulation).door == "closing", "it does not count as closed, and the cabin stays"
    simulation.change(InjectFault(target="lift_1", fault="lift_door_closes", active=False))
    until(simulation, door="open")


def test_a_person_in_the_cabin_rides_along_and_leaves_when_the_fault_ends() -> None:
    simulation = hall()
    simulation.change(InjectFault(target="lift_1", fault="lift_occupied"))

    def person() -> tuple[float, ...]:
        return next(thing.position[:2] for thing in simulation.objects().objects if thing.name == "lift_1.person")

    assert person() == pytest.approx((0.0, 0.0))
    ask(simulation, CallLift(client="amr1", floor="floor2"))
    until(simulation, floor="floor2")
    assert person() == pytest.approx((20.0, 0.0))
    simulation.change(InjectFault(target="lift_1", fault="lift_occupied", active=False))
    assert "lift_1.person" not in {thing.name for thing in simulation.objects().objects}
    put(simulation, 20.1)
    with pytest.raises(RequestRefused, match="'amr1' is in the cabin of 'lift_1': no room"):
        simulation.change(InjectFault(target="lift_1", fault="lift_occupied"))


def test_a_lift_that_others_have_taken() -> None:
    simulation = hall()
    simulation.change(InjectFault(target="lift_1", fault="lift_taken"))
    assert ask(simulation, CallLift(client="amr1", floor="floor1")).waiting == ("amr1",)
    with pytest.raises(RequestRefused, match="'others' has it"):
        ask(simulation, HoldDoor(client="amr1"))
    simulation.change(InjectFault(target="lift_1", fault="lift_taken", active=False))
    until(simulation, holder="amr1", door="open")
    ask(simulation, ReleaseLift(client="amr1"))
    with pytest.raises(RequestRefused, match="lift 'lift_9' is not known; known: \\['lift_1'\\]"):
        simulation.change(InjectFault(target="lift_9", fault="lift_taken"))


def test_its_model_and_state_are_published_and_traffic_is_seeded() -> None:
    model = hall().lifts["lift_1"].model()
    assert [(floor.name, floor.map, floor.pose.x) for floor in model.floors] == [
        ("floor1", "test", 0.0),
        ("floor2", "test_floor2", 20.0),
    ]
    simulation = hall(traffic=6.0)
    states = [m for t, m in drive(simulation, 60.0) if t is topics.LIFT_STATE]
    assert len(states) == 300 and any(s.moving and s.holder == "traffic" for s in states)
    assert states == [m for t, m in drive(hall(traffic=6.0), 60.0) if t is topics.LIFT_STATE]
