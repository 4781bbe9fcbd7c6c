"""Where the bus is: from the environment, or from a Zenoh configuration file for more than one machine."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import zenoh
from pydantic_settings import BaseSettings, SettingsConfigDict

DEFAULT_ROUTER = "tcp/127.0.0.1:7447"


class BusConfig(BaseSettings):
    """Read from ``RACKHAND_BUS_CONNECT``, ``…_LISTEN``, ``…_MODE``, ``…_LEASE`` and ``…_CONFIG``.

    ``connect`` and ``listen`` are comma-separated Zenoh endpoints (``tcp/…``, ``tls/…``, ``unixsock-stream/…``). A
    ``config`` file in Zenoh's own JSON5 replaces everything else: certificates, passwords, access control.

    ``lease``: seconds of silence after which others take this process for gone, as one that hangs or whose machine is
    unplugged; one that ends is noticed at once. A cell in lockstep, which must not depend on how fast the
    machine is, has a long one: a process that the load of the machine keeps from running would else be lost.
    """

    model_config = SettingsConfigDict(env_prefix="RACKHAND_BUS_", frozen=True)

    connect: str = DEFAULT_ROUTER
    listen: str = "tcp/127.0.0.1:0"
    mode: Literal["peer", "client", "router"] = "peer"
    lease: float = 1.0
    config: Path | None = None

    def zenoh_config(self) -> zenoh.Config:
        if self.config is not None:
            return zenoh.Config.from_file(str(self.config))
        return zenoh.Config.from_json5(json.dumps(self._settings()))

    def _settings(self) -> dict[str, Any]:
        """Loopback only, no multicast; peers find each other through the router's gossip and then talk directly."""
        settings: dict[str, Any] = {
            "mode": self.mode,
            "connect": {
                "endpoints": _split(self.connect),
                # A service may start before the router: it waits in the background and keeps trying.
                "timeout_ms": -1,
                "exit_on_failure": False,
                "retry": {"period_init_ms": 100, "period_max_ms": 1000, "period_increase_factor": 2},
            },
            "scouting": {"delay": 50, "multicast": {"enabled": False}, "gossip": {"enabled": True}},
            "timestamping": {"enabled": False},
            "queries_default_timeout": 2000,
            "transport": {
                "link": {"tx": {"lease": round(1000 * self.lease), "queue": {"size": _QUEUES}}},
                # Messages here are small; shared memory would leave segments behind after kill -9.
                "shared_memory": {"enabled": False},
            },
        }
        if self.mode != "client":
            settings["listen"] = {"endpoints": _split(self.listen)}
        return settings


# Batches a link may hold before DROP drops: the burst of one control step must fit.
_QUEUES = {
    "control": 2,
    "real_time": 16,
    "interactive_high": 4,
    "interactive_low": 4,
    "data_high": 16,
    "data": 16,
    "data_low": 4,
    "background": 4,
}


def _split(endpoints: str) -> list[str]:
    return [part.strip() for part in endpoints.split(",") if part.strip()]
