"""Shapes and curves that more than one view draws."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from rackhand.services.viewer.colours import NAME, Colour
from rackhand.services.viewer.items import Drawing


@cache  # the same few are drawn 25 times a second, and to make one takes as long as the rest of a shape
def ink(colour: Colour) -> Any:
    return rr.components.ColorBatch(colour).as_arrow_array()


@cache
def pen(width: float) -> Any:
    """``width`` in points of the screen."""
    return rr.components.RadiusBatch(rr.Radius.ui_points(width)).as_arrow_array()


def line(points: NDArray[np.floating], colour: Colour, width: float) -> rr.LineStrips3D:
    """A line through points (n, 3), ``width`` in points of the screen; fewer than two are none."""
    return rr.LineStrips3D([points] if len(points) > 1 else [], colors=ink(colour), radii=pen(width))


def name_tag(name: str, height: float) -> rr.Points3D:
    """What something is called, over the origin of its frame."""
    return rr.Points3D([(0.0, 0.0, height)], radii=0.0, colors=NAME, labels=[name], show_labels=True)


def curves(entity: str, names: Sequence[str], colours: Sequence[Colour]) -> Drawing:
    """What the curves of a plot are called, and their colours."""
    lines = rr.SeriesLines(names=names, colors=colours, widths=1.5)
    return Drawing(entity, (lines,), frame=None, static=True)
