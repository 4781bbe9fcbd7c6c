"""``python -m rackhand.services.viewer``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from rackhand.runtime.priority import RECORDER, VIEWER, set_niceness

EPILOG = """Examples:\n
  python -m rackhand.services.viewer\n
  python -m rackhand.services.viewer --host 0.0.0.0 --memory 1GB\n
  python -m rackhand.services.viewer --no-serve --save run.rrd\n
"""
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command(epilog=EPILOG)
def main(
    host: Annotated[str, typer.Option(help="Address to listen on (127.0.0.1: this machine only).")] = "127.0.0.1",
    web_port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the web viewer.")] = 9090,
    data_port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the data that viewers load.")] = 9876,
    memory: Annotated[
        str,
        typer.Option(
            envvar="RACKHAND_VIEWER_MEMORY", help="Memory for data kept for late viewers; the oldest data is dropped."
        ),
    ] = "256MB",
    rate: Annotated[
        float, typer.Option(envvar="RACKHAND_VIEWER_RATE", min=0.1, max=100, help="Maximum frames per second.")
    ] = 25.0,
    save: Annotated[Path | None, typer.Option(help="Also write all data to this .rrd file.")] = None,
    serve: Annotated[bool, typer.Option(help="Serve viewers.")] = True,
) -> None:
    """Draw what the bus says of a cell in Rerun."""
    try:
        import rerun  # noqa: F401
    except ImportError:
        print("the viewer needs Rerun: pip install 'rackhand[viewer]'", file=sys.stderr)
        raise SystemExit(2) from None
    set_niceness(VIEWER if serve else RECORDER)
    from rackhand.services.viewer.service import Settings, run

    raise SystemExit(run(Settings(host, web_port, data_port, memory, rate, save, serve)))


if __name__ == "__main__":
    app()
