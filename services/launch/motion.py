"""One CRF command to an arm, by way of the gateway."""

from __future__ import annotations

import http.client
import json
import urllib.error
import urllib.parse
import urllib.request

TIMEOUT = 15.0  # seconds; the gateway gives up before

# Loopback is never behind a proxy, whatever the environment says.
_opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))


class CannotAsk(Exception):
    """The arm was not reached; the text is for the user."""


def send_command(url: str, arm: str, command: str) -> str:
    """The answer's JSON text. Raises ``CannotAsk``."""
    request = urllib.request.Request(
        f"{url}/motion/{urllib.parse.quote(arm, safe='')}/command",
        data=command.encode(),
        headers={"content-type": "application/json"},
    )
    try:
        with _opener.open(request, timeout=TIMEOUT) as answer:
            return str(answer.read().decode())
    except urllib.error.HTTPError as error:
        raise CannotAsk(_reason(error)) from None
    except (OSError, ValueError, http.client.HTTPException):
        raise CannotAsk(f"no gateway answers at {url}. Is the cell up? Start it with `rackhand up`.") from None


def _reason(error: urllib.error.HTTPError) -> str:
    body = error.read().decode(errors="replace")
    try:
        return str(json.loads(body)["detail"])
    except (ValueError, KeyError, TypeError):
        return f"status {error.code}: {body[:200]}"
