"""The gateway: HTTP and WebSocket for clients on one side, the bus on the other.

Read in this order: ``service`` (the process), ``fleet`` and ``state`` (what is known of each robot), ``presence``
(which services are up), ``context`` (what routes work with); ``http`` (the application, errors, checks before routes),
``chassis_api`` (its routes), ``ws`` (its WebSocket), ``crf`` (arms), ``page`` (the web page).
"""
