"""Typed publish, subscribe and query on Zenoh. The only importer of ``zenoh``.

Read in this order: ``config`` (where the bus is), ``session`` (publish, call, liveliness), ``inbox`` (the queue a
service reads) with ``handlers`` (typed dispatch), ``requests`` and ``samples`` (what is in it), ``newest`` (a reader
that polls), ``router`` and ``health`` (two small processes).
"""

from rackhand.bus.config import BusConfig
from rackhand.bus.errors import BusError, CallTimeout, Refused, Unavailable
from rackhand.bus.handlers import Handlers, Posted, Presence
from rackhand.bus.inbox import Event, Inbox
from rackhand.bus.newest import Newest
from rackhand.bus.requests import Request
from rackhand.bus.samples import Sample
from rackhand.bus.session import Bus, Publisher

__all__ = [
    "Bus",
    "BusConfig",
    "BusError",
    "CallTimeout",
    "Event",
    "Handlers",
    "Inbox",
    "Newest",
    "Posted",
    "Presence",
    "Publisher",
    "Refused",
    "Request",
    "Sample",
    "Unavailable",
]
