"""The viewer: everything on the bus, drawn in Rerun. It only subscribes; nothing depends on it.

Read in this order: ``service`` (bus in, recordings out), ``picture`` (which view draws which topic), ``chassis``,
``arm``, ``world``, ``bus_view`` (messages to items), ``items``, ``recording`` (items to Rerun), ``blueprint``,
``server`` and ``page`` (serving it).
"""
