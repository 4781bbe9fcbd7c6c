"""The services of the cell, one process each. None imports another; they communicate over the bus.

Read ``launch`` (what is started), ``sim`` (the driver of simulated robots), ``planner`` (moves of a chassis),
``controller`` (motion of an arm), ``gateway`` (HTTP and WebSocket), ``viewer`` (live view).
"""
