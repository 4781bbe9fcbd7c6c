"""``python -m rackhand.services.controller``: the motion controller of one arm."""

from __future__ import annotations

import secrets
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import typer

from rackhand.bus import Bus
from rackhand.bus.log import configure_logging, get_logger
from rackhand.runtime.memory import freeze_gc
from rackhand.runtime.preparation import logged_progress
from rackhand.runtime.priority import run_in_real_time, set_short_slice
from rackhand.schemas.crf_requests import OPTIONAL_COMMANDS
from rackhand.schemas.service import ServiceId
from rackhand.services.controller import ik
from rackhand.services.controller.access.audit import AuditLog
from rackhand.services.controller.access.audit_writer import AuditWriter
from rackhand.services.controller.access.types import SECOND, AccessConfig
from rackhand.services.controller.controller import Controller
from rackhand.services.controller.service import ControllerService
from rackhand.services.controller.warm_up import warm_up
from rackhand.worlds.data import WorldFileError
from rackhand.worlds.world_model import load_world

log = get_logger(__name__)

# Seconds for which a planning thread may keep the interpreter from the control loop.
SWITCH_INTERVAL = 0.0005

_EXAMPLES = """
Motion controller of one arm, commanded by CRF requests.

Examples:

  python -m rackhand.services.controller --robot arm1 --arm ur5e

  python -m rackhand.services.controller --robot arm2 --arm fr3 --rate 500 --strict-crf

  python -m rackhand.services.controller --without setVelocity --without setTorque

In a cell, RACKHAND_CONTROLLER_STRICT_CRF=1 and RACKHAND_CONTROLLER_WITHOUT="setVelocity setTorque" say the same.
"""

app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command(help=_EXAMPLES)
def main(
    robot: Annotated[str, typer.Option(help="name of the arm on the bus")] = "arm1",
    arm: Annotated[str, typer.Option(help="profile of the arm, one of worlds/arms")] = "ur5e",
    world: Annotated[
        str | None,
        typer.Option(help="name or folder of the world, whose statics the arm keeps clear of  [default: none]"),
    ] = None,
    rate: Annotated[int, typer.Option(min=50, max=1000, help="commands per second")] = 250,
    state_dir: Annotated[Path | None, typer.Option(help="folder of the audit log  [default: var/ROBOT]")] = None,
    strict_crf: Annotated[
        bool, typer.Option(help="stops need priority, as in CRF", envvar="RACKHAND_CONTROLLER_STRICT_CRF")
    ] = False,
    without: Annotated[
        list[str] | None,
        typer.Option(
            help="a command that is not offered and answered 405; may be given several times",
            envvar="RACKHAND_CONTROLLER_WITHOUT",
        ),
    ] = None,
    keep_alive: Annotated[float, typer.Option(min=0.1, help="seconds until an unused lock expires")] = 10.0,
    retry: Annotated[
        float,
        typer.Option(
            min=0.0,
            help="seconds for which a path that is sent again with the same id and text is taken to be a retry",
            envvar="RACKHAND_CONTROLLER_RETRY",
        ),
    ] = 5.0,
) -> None:
    if SECOND % rate:
        raise typer.BadParameter(f"{rate} Hz: want a rate whose period is a whole number of nanoseconds")
    not_offered = frozenset(without or ())
    if strangers := sorted(not_offered - OPTIONAL_COMMANDS):
        known = ", ".join(sorted(OPTIONAL_COMMANDS))
        raise typer.BadParameter(f"{', '.join(strangers)}: want one of {known}", param_hint="--without")
    try:
        model = _model(arm, robot, world)
        audit_log = AuditLog((state_dir or Path("var") / robot) / "audit.jsonl")
    except (ik.ArmError, WorldFileError, OSError) as error:
        typer.echo(f"controller of {robot}: {error}", err=True)
        raise typer.Exit(2) from None
    configure_logging("controller")
    set_short_slice()
    sys.setswitchinterval(SWITCH_INTERVAL)
    period_ns = SECOND // rate
    with logged_progress(log):
        warm_up(model, period_ns)
    access = AccessConfig(keep_alive_ns=int(keep_alive * SECOND), strict_crf=strict_crf, retry_ns=int(retry * SECOND))
    audit = AuditWriter(audit_log, lambda error: log.error("the audit log cannot be written", error=str(error)))
    with (
        ThreadPoolExecutor(1, thread_name_prefix="plan") as planning,
        ThreadPoolExecutor(1, thread_name_prefix="read") as reading,
    ):
        controller = Controller(
            model, period_ns, planning, lambda: secrets.token_hex(8), access, time.perf_counter_ns, not_offered, reading
        )
        try:
            with Bus(ServiceId("controller", robot)) as bus:
                bus.handle_signals()
                freeze_gc()
                if not run_in_real_time():
                    log.info(
                        "real-time scheduling not permitted: ticks may be late on a busy machine",
                        help="docs/development.md",
                    )
                ControllerService(bus, robot, model.n, controller, audit).run()
        finally:
            planning.shutdown(wait=False, cancel_futures=True)
            reading.shutdown(wait=False, cancel_futures=True)
            audit.close()


def _model(kind: str, robot: str, world: str | None) -> ik.Arm:
    """The arm in its station. Raises ``ik.ArmError`` and ``WorldFileError``."""
    model = ik.load_arm(kind)
    if world is None:
        return model
    loaded = load_world(world)
    if robot not in loaded.arms:
        raise WorldFileError(f"--robot {robot}: arms of {loaded.name} are {sorted(loaded.arms)}")
    return ik.in_station(model, loaded, robot)


if __name__ == "__main__":
    app()
