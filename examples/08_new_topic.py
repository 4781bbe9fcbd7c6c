"""A node that adds a topic: how far a chassis has driven, once for every so many messages of its odometry.

python examples/08_new_topic.py tcp/127.0.0.1:7447

The row below is all that the bus needs. As a row of ``schemas/topics.py``, with the name of a WebSocket topic, the
gateway serves it, and the reference, the AsyncAPI document and the access-control lists have it too.
"""

import sys

from rackhand.bus import Bus, BusConfig, Sample
from rackhand.schemas import topics
from rackhand.schemas.base import Message, Stamp
from rackhand.schemas.service import ServiceId
from rackhand.schemas.topics import Qos, Topic

ROBOT, EVERY, REPORTS = "amr1", 25, 4


class Mileage(Message):
    """Metres driven since the node began; ``stamp`` in ns, as that of the odometry."""

    stamp: Stamp
    driven: float


MILEAGE = Topic(
    "node/mileage", "rackhand/{robot}/node/mileage", "chassis", Mileage, "node", (), 2, Qos.STREAM, "metres driven"
)

with Bus(ServiceId("mileage", ROBOT), BusConfig(connect=sys.argv[1])) as bus:
    odometry = bus.inbox().subscribe(topics.ODOMETRY, ROBOT)
    reader = bus.inbox().subscribe(MILEAGE, ROBOT)  # as another process would
    mileage = bus.publisher(MILEAGE, ROBOT)
    bus.announce()  # /healthz shows it as up
    driven, before, seen = 0.0, None, 0
    while seen < EVERY * REPORTS:
        event = odometry.get(timeout=20)
        assert isinstance(event, Sample), "no odometry within 20 s"
        now, seen = event.message, seen + 1
        if before is not None:
            driven += ((now.pose.x - before.pose.x) ** 2 + (now.pose.y - before.pose.y) ** 2) ** 0.5
        before = now
        if seen % EVERY == 0:
            mileage.put(Mileage(stamp=now.stamp, driven=driven))
            received = reader.get(timeout=20)
            print(f"{received.message.stamp / 1e9:.2f} s  {received.message.driven:.3f} m")
