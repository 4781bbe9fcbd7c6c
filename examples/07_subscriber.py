"""A subscriber on Zenoh that imports nothing of rackhand: the poses of a chassis, in MessagePack.

python examples/07_subscriber.py tcp/127.0.0.1:7447
"""

import sys

import msgspec
import zenoh

config = zenoh.Config.from_json5(f'{{mode: "client", connect: {{endpoints: ["{sys.argv[1]}"]}}}}')
with zenoh.open(config) as session, session.declare_subscriber("rackhand/amr1/chassis/pose") as poses:
    for _ in range(5):
        message = msgspec.msgpack.decode(poses.recv().payload.to_bytes())
        pose = message["pose"]
        print(f"{message['stamp'] / 1e9:.2f} s  x {pose['x']:.3f} m  y {pose['y']:.3f} m  yaw {pose['yaw']:.3f} rad")
