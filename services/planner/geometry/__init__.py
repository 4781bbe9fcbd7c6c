"""Poses, grids and the body of the chassis, as values that compiled functions take.

Read in this order: ``se2`` (poses as arrays; the convention is that of ``rackhand.schemas.planar``), ``cells`` (where
the cells of a grid lie), ``footprint`` (the body polygon, its discs, the signed distance to its sides).
"""
