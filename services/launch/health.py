"""What the gateway's ``/healthz`` says of the cell."""

from __future__ import annotations

import http
import http.client
import json
import urllib.error
import urllib.request
from dataclasses import dataclass
from typing import Any

# Loopback is never behind a proxy, whatever the environment says.
_opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))


@dataclass(frozen=True)
class Health:
    """One row a service. ``all_up`` is the gateway's own verdict (status 200)."""

    all_up: bool
    rows: tuple[dict[str, Any], ...]

    @property
    def down(self) -> tuple[str, ...]:
        """``robot/service`` of all that should be up and is not."""
        return tuple(_name(row) for row in self.rows if row.get("status") != "up" and row.get("expected", True))

    @property
    def up(self) -> tuple[str, ...]:
        """``robot/service`` of all that is there, wanted or not."""
        return tuple(_name(row) for row in self.rows if row.get("status") == "up")


def _name(row: dict[str, Any]) -> str:
    return f"{row.get('robot')}/{row.get('service')}"


def ask_health(url: str, timeout: float = 1.0) -> Health | None:
    """Ask the gateway at ``url``; None where no gateway answers."""
    try:
        with _opener.open(f"{url}/healthz", timeout=timeout) as answer:
            return _read(200, answer.read())
    except urllib.error.HTTPError as error:
        return _read_error(error)
    except (OSError, http.client.HTTPException):
        return None


def does_simulator_answer(url: str, timeout: float = 3.0) -> bool:
    """Whether requests to the simulator are answered, as the gateway at ``url`` says."""
    try:
        with _opener.open(f"{url}/world/faults", timeout=timeout):
            return True
    except urllib.error.HTTPError as error:
        return error.code != http.HTTPStatus.SERVICE_UNAVAILABLE  # without the gateway's secret it cannot be known
    except (OSError, http.client.HTTPException):
        return False


def _read_error(error: urllib.error.HTTPError) -> Health | None:
    try:
        return _read(error.code, error.read())
    except (OSError, http.client.HTTPException):  # on a busy machine the body may come too late
        return None


def _read(status: int, body: bytes) -> Health | None:
    try:
        rows = json.loads(body)["services"]
        return Health(status == 200, tuple(dict(row) for row in rows))
    except (ValueError, KeyError, TypeError):
        return None
