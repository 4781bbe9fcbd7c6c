"""All commands of this controller. A command of the schema without a row is an error at import."""

from __future__ import annotations

from rackhand.schemas import crf_requests as crf
from rackhand.services.controller.commands import locking, paths, reading, references, settings
from rackhand.services.controller.commands.spec import CommandTable

COMMANDS = CommandTable(
    (*locking.SPECS, *paths.SPECS, *references.SPECS, *settings.SPECS, *reading.SPECS), schema=crf.REQUESTS
)
