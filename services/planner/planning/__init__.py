"""The global plan: from a pose to a goal for the real footprint. Values in, values out; no clock, no bus.

Read in this order: ``field`` (distance to the nearest blocked cell), ``distance_grid`` (clearance of a footprint in
it), ``tiles`` (the same on large maps), ``inflation`` (what a metre costs), ``cost_to_go`` (Dijkstra for the inscribed
circle), ``shaping`` (from cells to a smooth path), ``lattice`` (A* with the footprint for tight places, on ``heap``),
``plan`` (``GlobalPlanner``, which puts them together), ``windows`` (plans on maps of any size), ``goals`` (what is
refused before any planning).
"""
