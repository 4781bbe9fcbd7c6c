"""A cell between two tests: a new run of its world, and nothing left of what the last test asked of its services."""

from __future__ import annotations

from rackhand.services.launch.background import CellError
from rackhand.testing.arm import Arm
from rackhand.testing.cell import Cell
from rackhand.testing.chassis import Chassis


def freshen(cell: Cell, seed: int | None = None) -> None:
    """Begin a new run of the world, paused, with every service up and taking part in it.

    The chassis is in automatic mode with its default settings, on the map that it came with, and does nothing. Nobody
    holds an arm. Kept: stored moves and maps, and the velocity profile of an arm.
    """
    cell.wait_until_up()
    cell.pause()
    with Chassis(cell) as chassis:
        chassis.cancel()
        _restore_settings(chassis)
    for name in cell.crf:
        with Arm(cell, name, client="fresh", priority=1) as arm:
            arm.ask("lockControl", priority=1, force=True)
            arm.ask("unlockControl", priority=1)
    former = cell.inspect().clock.run
    commanded = set(cell.inspect().command_stamps)
    cell.reset(seed)

    def joined() -> bool | None:
        world = cell.inspect()
        answered = world.clock.run != former and commanded <= set(world.command_stamps)
        return True if answered and len(world.participants) >= len(commanded) else None

    try:
        cell.wait_for(joined, "every robot's service has joined the new run")
    except CellError as error:
        raise CellError(f"the world was reset; participants: {cell.inspect().participants}\n{error}") from None
    cell.pause()


def _restore_settings(chassis: Chassis) -> None:
    chassis.request("POST", "/services/wheel_control/set_control_mode", {"control_mode": "auto"})
    chassis.request("POST", "/services/wheel_control/set_emergency_stop", {"enable": False})
    changed = chassis.request("GET", "/system/settings/user")
    if changed:
        chassis.request("PATCH", "/system/settings/user", dict.fromkeys(changed))
    if chassis.request("GET", "/chassis/current-map")["uid"] != chassis.base_map()["uid"]:
        chassis.use_stored_map()
