"""A judge reads ground truth: how far the robot is from where it believes to be, and what it has touched.

python examples/10_judge.py tcp/127.0.0.1:7447
"""

import sys

from rackhand.bus import Bus, BusConfig
from rackhand.schemas import topics
from rackhand.schemas.service import CELL, ServiceId
from rackhand.testing import Judge, distance

with Judge(sys.argv[1]) as judge, Bus(ServiceId("example", CELL), BusConfig(connect=sys.argv[1])) as bus:
    believed = bus.inbox().subscribe(topics.POSE, "amr1", depth=1).get(timeout=20).message.pose
    true = judge.true_pose("amr1")
    print(f"truly at ({true.x:.3f}, {true.y:.3f}), off by {1000 * distance(true, believed.x, believed.y):.1f} mm")
    print(f"contacts: {[f'{c.robot} with {c.other}' for c in judge.contacts()]}")
