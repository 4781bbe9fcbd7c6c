"""How the pixels of a picture are read as cells: ``mode``, ``negate`` and the thresholds of a map's YAML.

As Nav2's map_server does (nav2_map_server/src/map_io.cpp): what a pixel is occupied with, from 0 to 1, is how dark it
is. A map in the store has one reading only, so that a picture is rewritten with its grey values when it is imported.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from PIL import Image

FREE, UNKNOWN, OCCUPIED = 254, 205, 0  # grey values of the store
RAW_OCCUPIED = 100  # raw pixels are the percentages of an occupancy grid; what is above is unknown
Mode = Literal["trinary", "scale", "raw"]
Grey = NDArray[np.uint8]


@dataclass(frozen=True)
class Reading:
    """``trinary``: darker than ``occupied`` is occupied, lighter than ``free`` is free, else unknown. ``scale`` differs
    in transparent pixels only, which the store's pictures do not have: a probability between the thresholds is unknown.
    ``raw``: 0 is free, 100 is occupied, all else is unknown; no thresholds, no ``negate``.
    """

    mode: Mode = "trinary"
    negate: bool = False
    occupied: float = 0.65
    free: float = 0.196

    @staticmethod
    def of(description: Mapping[str, Any]) -> Reading:
        """What a map's YAML says. Raises ``ValueError`` naming the key that cannot be obeyed."""
        mode, negate = description.get("mode", "trinary"), description.get("negate", 0)
        if mode not in get_args(Mode):
            raise ValueError(f"mode is {mode!r}, want one of {', '.join(get_args(Mode))}")
        if negate not in (0, 1):
            raise ValueError(f"negate is {negate!r}, want 0 (occupied dark, free light) or 1 (the other way round)")
        occupied = _share(description, "occupied_thresh", Reading.occupied)
        free = _share(description, "free_thresh", Reading.free)
        if free >= occupied:
            raise ValueError(f"free_thresh is {free:g}, want less than occupied_thresh, which is {occupied:g}")
        return Reading(mode, bool(negate), occupied, free)

    def cells(self, grey: Grey) -> Grey:
        """The grey values of the store: ``FREE``, ``UNKNOWN`` and ``OCCUPIED``."""
        value = np.arange(256)
        if self.mode == "raw":
            occupied, free = value == RAW_OCCUPIED, value == 0
        else:
            share = (value if self.negate else 255 - value) / 255.0
            occupied, free = share > self.occupied, share < self.free
        table = np.full(256, UNKNOWN, dtype=np.uint8)
        table[free], table[occupied] = FREE, OCCUPIED
        return np.asarray(table[grey])


STORED = Reading()
"""How the store's pictures are read."""


def stored_png(png: bytes, reading: Reading) -> bytes:
    """An 8-bit grey picture as the store has it: unchanged if both readings find the same cells in it."""
    with Image.open(io.BytesIO(png), formats=["PNG"]) as image:
        grey = np.asarray(image)
    cells = reading.cells(grey)
    if (cells == STORED.cells(grey)).all():
        return png
    file = io.BytesIO()
    Image.fromarray(cells).save(file, "PNG")
    return file.getvalue()


def _share(description: Mapping[str, Any], key: str, default: float) -> float:
    value = description.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= 1.0:
        raise ValueError(f"{key} is {value!r}, want a number from 0 to 1")
    return float(value)
