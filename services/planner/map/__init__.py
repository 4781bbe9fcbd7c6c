"""Maps: requests about them, the store, and what the planner reads from the one in use.

Read in this order: ``overlays`` (GeoJSON as typed points of interest, lines and zones), ``grid`` (PNG and overlays as
cells), ``check`` (what is refused), ``directory`` (a map from files), ``store`` (SQLite), ``service`` (requests).
"""
