"""How messages are carried: typed publish, subscribe, query on Zenoh. The only importer of ``zenoh``."""

from rackhand.bus.config import BusConfig
from rackhand.bus.errors import BusError, CallTimeout, Refused, Unavailable
from rackhand.bus.inbox import Event, Inbox, Presence, Request
from rackhand.bus.newest import Newest
from rackhand.bus.samples import Sample
from rackhand.bus.session import Bus, Publisher

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
