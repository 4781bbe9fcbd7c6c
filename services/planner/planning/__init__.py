"""The global plan: from a pose to a goal for the real footprint. Values in, values out; no clock, no bus.

Read in this order: ``field`` (distance to the nearest blocked cell), ``distance_grid`` (clearance of a footprint in
it), ``inflation`` (what a metre costs), ``cost_to_go`` (Dijkstra for the inscribed circle, on ``heap``), ``shaping``
(from cells to a smooth path), ``lattice`` (A* with the footprint for tight places), ``plan`` (``GlobalPlanner``, which
puts them together), ``goals`` (what is refused before any planning).
"""
