"""A client that rides a lift with a chassis in a joined world, by the requests that docs/lifts.md lists."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

from rackhand.schemas.base import Pose2
from rackhand.schemas.lift import CallLift, GetLift, GoToFloor, HoldDoor, LiftState, ReleaseLift
from rackhand.schemas.maps import ListMaps, SelectMap
from rackhand.schemas.moves import TERMINAL, Move
from rackhand.schemas.planar import compose
from rackhand.schemas.refusal import RequestRefused
from tests.joined.chassis import JoinedChassis

CLIENT = "fleet"
BEFORE = 2.4  # m from the middle of the cabin to where the chassis waits
HOLD_PERIOD = 0.4  # s between two requests to hold the door


class LiftUser:
    """Calls the lift, holds its doors, changes maps and posts moves for one chassis."""

    def __init__(self, driver: JoinedChassis, lift: str = "lift_1") -> None:
        self.driver, self.world, self.lift = driver, driver.world, lift
        self.model = self.world.simulation.lifts[lift].model()

    # -- the lift ----------------------------------------------------------------------------------------------------

    def ask(self, request: Any) -> LiftState:
        return self.world.ask_lift(request, self.lift)

    @property
    def state(self) -> LiftState:
        return self.ask(GetLift())

    def wait_for(self, within: float = 60.0, **wanted: Any) -> None:
        """Let time pass until the lift's state is so."""

        def is_so() -> bool | None:
            state = self.state
            return True if all(getattr(state, name) == value for name, value in wanted.items()) else None

        self.world.wait_for(is_so, f"{self.lift} is {wanted}: {self.state}", within, 0.1)

    def call(self, floor: str) -> None:
        """Until the lift is there, open, for this client."""
        self.ask(CallLift(client=CLIENT, floor=floor))
        self.wait_for(holder=CLIENT, floor=floor, door="open")

    def ride(self, floor: str) -> None:
        """Go to the floor, and use its map there."""
        self.ask(GoToFloor(client=CLIENT, floor=floor))
        self.wait_for(floor=floor, door="open")
        self.use_map(floor)

    def release(self) -> None:
        self.ask(ReleaseLift(client=CLIENT))

    # -- the chassis -------------------------------------------------------------------------------------------------

    def use_map(self, floor: str) -> None:
        name = next(one.map for one in self.model.floors if one.name == floor)
        stored = next(one for one in self.driver.ask_maps(ListMaps()).maps if one.map_name == name)
        self.driver.ask_maps(SelectMap(id=stored.id))

    def cabin(self, floor: str) -> tuple[float, float, float]:
        """The middle of the cabin, its yaw out of the door."""
        pose = next(one.pose for one in self.model.floors if one.name == floor)
        return pose.x, pose.y, pose.yaw

    def waiting(self, floor: str) -> Pose2:
        """Before the door, facing it."""
        x, y, yaw = compose(self.cabin(floor), (BEFORE, 0.0, math.pi))
        return Pose2(x=x, y=y, yaw=yaw)

    def enter(self, floor: str, **fields: Any) -> int:
        """The ``enter_elevator`` move to the middle of the cabin, facing the door."""
        x, y, yaw = self.cabin(floor)
        return self.driver.post(
            **{"type": "enter_elevator", "target_x": x, "target_y": y, "target_ori": yaw} | fields  # type: ignore[arg-type]
        )

    def leave(self, floor: str, kind: str = "standard") -> int:
        """A move to the waiting point, of that type."""
        at = self.waiting(floor)
        return self.driver.post(type=kind, target_x=at.x, target_y=at.y, target_ori=at.yaw)

    def finish(self, move: int, within: float = 60.0, hold: bool = True) -> Move:
        """Let time pass until that move has ended; ``hold``: the door meanwhile."""
        end = self.world.now() + within
        while (found := self.driver.move(move)).state not in TERMINAL:
            assert self.world.now() < end, f"{within:g} s passed: {self.driver.planning_state}"
            if hold:
                with suppress(RequestRefused):
                    self.ask(HoldDoor(client=CLIENT))
            self._advance()
        return found

    def _advance(self) -> None:
        """Let time pass until the door must be held again."""
        self.world.advance(HOLD_PERIOD)

    def round_trip(self, first: str, second: str) -> tuple[Move, ...]:
        """From the waiting point of one floor to that of the other and back; every move of it."""
        moves = []
        for here, there in ((first, second), (second, first)):
            self.call(here)
            moves.append(self.finish(self.enter(here)))
            self.ride(there)
            moves.append(self.finish(self.leave(there)))
            self.release()
        return tuple(moves)
