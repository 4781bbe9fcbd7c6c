"""``python -m rackhand.services.gateway``."""

from __future__ import annotations

from typing import Annotated, Any

import typer
from pydantic import ValidationError

from rackhand.runtime.priority import GATEWAY, set_niceness
from rackhand.schemas.codec import explain
from rackhand.services.gateway.service import run
from rackhand.services.gateway.settings import Settings, parse_service

EPILOG = """Examples:\n
  python -m rackhand.services.gateway\n
  python -m rackhand.services.gateway --robot amr1 --robot amr2\n
  python -m rackhand.services.gateway --name second --robot amr2 --port 8091\n
  python -m rackhand.services.gateway --host 0.0.0.0 --expect amr1/planner --expect world/sim\n
  python -m rackhand.services.gateway --arm arm1 --crf-port arm1=5000\n
Everything else is set in the environment, as in RACKHAND_GATEWAY_SECRET=… or RACKHAND_GATEWAY_SERVICE_STATUS=201.
"""
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command(epilog=EPILOG)
def main(
    robot: Annotated[
        list[str] | None,
        typer.Option(
            help="A mobile robot to serve (amr1); may be given several times. The first is the default robot, the "
            "others are served under /robots/NAME."
        ),
    ] = None,
    name: Annotated[
        str | None, typer.Option(help="Name of this gateway on the bus (cell); another one for each further gateway.")
    ] = None,
    host: Annotated[str | None, typer.Option(help="Address to listen on (127.0.0.1: this machine only).")] = None,
    port: Annotated[int | None, typer.Option(help="TCP port to listen on (8090).")] = None,
    arm: Annotated[
        list[str] | None, typer.Option(help="An arm to serve under /motion/ARM; may be given several times.")
    ] = None,
    crf_port: Annotated[
        list[str] | None,
        typer.Option(
            help="ARM=PORT: a port for CRF's own packet framing on TCP (0: any free one); may be given several times."
        ),
    ] = None,
    expect: Annotated[
        list[str] | None,
        typer.Option(
            help="ROBOT/SERVICE that must be up for /healthz to answer 200; may be given several times. "
            "By default cell/router, world/sim, the robots' planners and the arms' controllers."
        ),
    ] = None,
) -> None:
    """HTTP and WebSocket for clients of the robots of a cell."""
    given: dict[str, Any] = {
        "name": name,
        "robots": tuple(robot) if robot else None,
        "host": host,
        "port": port,
        "arms": tuple(arm) if arm else None,
        "crf_ports": dict(map(_parse_port, crf_port)) if crf_port else None,
        "expect": tuple(expect) if expect else None,
    }
    try:
        settings = Settings(**{name: value for name, value in given.items() if value is not None})
        for text in settings.expect:
            parse_service(text)
    except ValidationError as error:
        raise typer.BadParameter(explain(error)) from None
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--expect") from None
    set_niceness(GATEWAY)
    run(settings)


def _parse_port(text: str) -> tuple[str, int]:
    """``arm1=5000``. Raises ``typer.BadParameter``."""
    arm, equals, port = text.partition("=")
    if not (arm and equals and port.isascii() and port.isdecimal()):
        raise typer.BadParameter(f"{text!r}: want ARM=PORT, as in arm1=5000", param_hint="--crf-port")
    return arm, int(port)


if __name__ == "__main__":
    app()
