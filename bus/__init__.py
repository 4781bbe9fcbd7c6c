"""How messages are carried: typed publish, subscribe, query on Zenoh. The only importer of ``zenoh``."""

from bus.config import BusConfig
from bus.errors import BusError, CallTimeout, Refused, Unavailable
from bus.inbox import Event, Inbox, Presence, Request
from bus.newest import Newest
from bus.samples import Sample
from bus.session import Bus, Publisher

__all__ = [
    "Bus",
    "BusConfig",
    "BusError",
    "CallTimeout",
    "Event",
    "Inbox",
    "Newest",
    "Presence",
    "Publisher",
    "Refused",
    "Request",
    "Sample",
    "Unavailable",
]
