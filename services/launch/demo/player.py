"""Plays the story: one step after the other, over the clients of the chassis and of the arm."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

from rackhand.services.launch.demo import picking
from rackhand.services.launch.demo.arm import ArmClient, Interrupted
from rackhand.services.launch.demo.chassis import ChassisClient
from rackhand.services.launch.demo.console import Output
from rackhand.services.launch.demo.errors import StoryError
from rackhand.services.launch.demo.picking import Base, Goods
from rackhand.services.launch.demo.story import Action, Charge, Jack, Lock, Move, Pick, Step, Unlock


class Player:
    """``arm`` picks; ``intruder`` is a client with a smaller priority number. ``goods``: the inventory, by name."""

    def __init__(
        self,
        chassis: ChassisClient,
        arm: ArmClient,
        intruder: ArmClient,
        base: Base,
        goods: Mapping[str, Goods],
        output: Output,
    ) -> None:
        self.chassis, self.arm, self._intruder = chassis, arm, intruder
        self._base, self._goods, self._output = base, goods, output
        self._points = chassis.points()

    def play(self, story: Sequence[Step]) -> None:
        """Raises ``StoryError``, whose text begins with the step that failed."""
        start = self.chassis.now()
        for number, step in enumerate(story, 1):
            begun, wall = self.chassis.now(), time.monotonic()
            self._output.begin(number, len(story), step.title, begun - start)
            try:
                with self._output.progress():
                    self._do(step.action)
            except StoryError as error:
                raise StoryError(f"step {number}, {step.title}: {error}") from None
            except (EOFError, OSError) as error:
                raise StoryError(f"step {number}, {step.title}: the connection ended: {error!r}") from None
            self._output.end(step.title, self.chassis.now() - begun, time.monotonic() - wall)

    def _do(self, action: Action) -> None:
        match action:
            case Move(kind, point):
                self.chassis.move(kind, **self._target(point))
            case Jack(direction):
                self.chassis.jack(direction)
            case Lock():
                self._lock()
            case Pick(item, interrupted):
                self._pick(self._goods[item], interrupted)
            case Unlock():
                self._swing(picking.TO_TABLE)
                self.arm.unlock()
            case Charge(point):
                self.chassis.move("charge", **self._target(point))
                self.chassis.wait_until_charging()

    def _target(self, point: str) -> dict[str, float]:
        if point not in self._points:
            raise StoryError(f"the map has no point {point!r}; it has {sorted(self._points)}")
        x, y, heading = self._points[point]
        return {"target_x": x, "target_y": y, "target_ori": heading}

    # -- the arm -----------------------------------------------------------------------------------------------------

    def _lock(self) -> None:
        if not self.arm.lock():
            self.arm.wait_for_control()

    def _pick(self, item: Goods, interrupted: bool) -> None:
        rack, base = self.chassis.rack_pose(), self._base
        on_the_way = item.before_shelf(rack), item.above_lid(rack), item.pressed(rack)
        before, above, lid = (base.tool(point, picking.ACROSS) for point in on_the_way)
        over, down = (
            base.tool(item.over_target(above_table), picking.ALONG)
            for above_table in (picking.OVER_TABLE, picking.SET_DOWN)
        )
        self._swing(picking.TO_TABLE)
        self._swing(picking.TO_SHELF)
        self._tool(before, straight=False)
        self._tool(above, straight=False)
        self._tool(lid, straight=True)
        self.arm.suction(True)
        self._tool(above, straight=True)
        self._tool(before, straight=False)
        if interrupted:
            self._interrupt()
        self._swing(picking.TO_SHELF)
        self._swing(picking.TO_TABLE)
        self._tool(over, straight=False)
        self._tool(down, straight=True)
        self.arm.suction(False)
        self._tool(over, straight=True)

    def _interrupt(self) -> None:
        """Another client takes control while the arm turns, moves a joint with the item held, and gives back."""
        self._start_swing(picking.TO_SHELF + 0.6)
        if not self._intruder.lock():
            raise StoryError("the client with the smaller priority number was not given control")
        self._output.waiting("another client, which has taken control")
        joints = self._intruder.joints()
        self._intruder.start_joints([*joints[:5], joints[5] + 0.3])
        self._intruder.finish()
        try:
            self.arm.finish()
        except Interrupted:
            pass
        else:
            raise StoryError("the arm's first client was not informed that it had lost control")
        if self.arm.lock():
            raise StoryError("control was granted to the first client while the other one held it")
        self._intruder.unlock()
        self.arm.wait_for_control()

    def _swing(self, joint: float) -> None:
        """Turn about the base in the tucked posture."""
        self._drive(lambda: self._start_swing(joint))

    def _start_swing(self, joint: float) -> None:
        self.arm.start_joints([joint, *picking.TUCKED, self.arm.joints()[5]])

    def _tool(self, pose: picking.Json, straight: bool) -> None:
        self._drive(lambda: self.arm.start_tool(pose, straight=straight))

    def _drive(self, start: Callable[[], None]) -> None:
        """Start a path and wait for its end; where another client takes control, wait for that and drive it again."""
        while True:
            try:
                start()
                self.arm.finish()
                return
            except Interrupted:
                self._lock()
