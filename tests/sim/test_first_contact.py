"""Nothing is compiled at the first contact: a physics step that waits for a compiler leaves a second without scans."""

from __future__ import annotations

import subprocess
import sys

# A process of its own: in this one other tests have compiled things already.
SCRIPT = """
import numpy as np
from rackhand.services.sim.world import contact_log, touch_log

contacts, touches = contact_log.ContactLog({1: "amr1"}, 3, str), touch_log.TouchLog(["floor", "body", "crate"])
before = [*contact_log._any_of.signatures, *touch_log._mark.signatures]

class Data:
    ncon = 1
    class contact:
        geom = np.array([(1, 2)], np.int32)

assert contacts.touches(Data)
touches.observe(Data, 20)
print(len(before), len([*contact_log._any_of.signatures, *touch_log._mark.signatures]), len(touches.rows))
"""


def test_nothing_is_compiled_at_the_first_contact() -> None:
    said = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True, timeout=240, check=False)
    assert said.stdout == "2 2 1\n", said.stderr
