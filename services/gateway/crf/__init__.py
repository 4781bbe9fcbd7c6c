"""CRF clients of arms. Read in this order: ``text`` (what the gateway reads of a request), ``session`` (one client),
``hub`` (the clients of an arm, events to them), ``motion`` (HTTP and WebSocket), ``tcp`` (CRF's packet framing).
"""
