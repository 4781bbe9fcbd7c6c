"""Runs a supervisor over processes given as JSON: what the tests start, signal and kill."""

from __future__ import annotations

import asyncio
import json
import os
import sys

from rackhand.services.launch.processes import Address, Process
from rackhand.services.launch.restarts import RestartPolicy
from rackhand.services.launch.supervisor import Supervisor


def main() -> None:
    given = json.loads(sys.argv[1])
    processes = [
        Process(
            p["name"],
            tuple(p["argv"]),
            tuple(p.get("needs", ())),
            Address(*p["listens"]) if "listens" in p else None,
            optional=p.get("optional", False),
        )
        for p in given["processes"]
    ]
    supervisor = Supervisor(
        processes, os.environ, policy=RestartPolicy(**given.get("policy", {})), grace=given.get("grace", 5.0)
    )
    sys.exit(asyncio.run(supervisor.run()))


if __name__ == "__main__":
    main()
