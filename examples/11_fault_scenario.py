"""A fault in a cell of its own: the lidar dies, the move fails with its reason, and after the repair it succeeds.

python examples/11_fault_scenario.py
"""

from rackhand.testing import Cell, Chassis

with Cell(world="empty", seed=7) as cell, Chassis(cell) as chassis:
    cell.fault("lidar_dead", "amr1")
    move = chassis.drive("standard", target_x=3.0, target_y=0.0)
    print(f"{move['state']}: {move['fail_message']}")
    assert (move["state"], move["fail_reason"]) == ("failed", 16), move

    cell.clear("lidar_dead", "amr1")
    cell.advance(1.0)
    cell.resume()
    move = chassis.drive("standard", target_x=3.0, target_y=0.0)
    print(f"{move['state']} at {cell.true_pose('amr1')}")
    assert move["state"] == "succeeded", move
