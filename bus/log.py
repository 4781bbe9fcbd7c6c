"""Readable log lines with service name and time; without both under the supervisor, which adds them to each line."""

from __future__ import annotations

import logging
import os
import sys
from typing import Any

import structlog

SUPERVISED = "RACKHAND_SUPERVISED"


def configure_logging(service: str, level: str = "INFO") -> None:
    """Set up logging of one process; ``RACKHAND_LOG_LEVEL`` in the environment has the last word."""
    chosen = os.environ.get("RACKHAND_LOG_LEVEL", level).upper()
    stamped: list[Any] = []
    if not os.environ.get(SUPERVISED):
        stamped = [structlog.processors.TimeStamper(fmt="%H:%M:%S", utc=False, key="time"), _named(service)]
    chain: list[Any] = [*stamped, structlog.processors.add_log_level, structlog.processors.format_exc_info, _render]
    structlog.configure(
        processors=chain,
        wrapper_class=structlog.make_filtering_bound_logger(logging.getLevelNamesMapping().get(chosen, logging.INFO)),
        logger_factory=structlog.PrintLoggerFactory(file=sys.stderr),
    )


def get_logger(name: str) -> Any:
    """A logger of module ``name``: ``log.info("text", key=value)``."""
    return structlog.get_logger(name)


def _named(service: str) -> Any:
    def add(_logger: Any, _method: str, event: dict[str, Any]) -> dict[str, Any]:
        event["service"] = service
        return event

    return add


def _render(_logger: Any, _method: str, event: dict[str, Any]) -> str:
    """``12:00:01 sim      warning: text  key=value``; the level info is left out."""
    prefix = f"{event.pop('time')} {event.pop('service'):<10} " if "time" in event else ""
    level, text, trace = event.pop("level"), event.pop("event"), event.pop("exception", "")
    said = text if level == "info" else f"{level}: {text}"
    pairs = "  ".join(f"{key}={value}" for key, value in event.items())
    return prefix + "  ".join(part for part in (said, pairs) if part) + (f"\n{trace}" if trace else "")
