"""From a plan to the twist of this tick. Values in, values out; no clock, no bus.

Read in this order: ``speed_profile`` (limits on commands), ``pursuit`` and ``route`` (progress along a plan),
``driving`` (the twist that follows it), ``dynamic_avoidance`` (whether a dynamic obstacle comes too near),
``mppi_costs`` and ``mppi`` (the twist that avoids it), ``progress_checker`` (stuck, and when a move fails),
``braking_guard`` (the last check of every command).
"""
