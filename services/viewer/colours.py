"""One meaning, one colour, wherever it is drawn: RGBA, 0 … 255."""

from __future__ import annotations

Colour = tuple[int, int, int, int]

SCAN: Colour = (235, 64, 52, 255)
PATH = (46, 134, 255, 255)
TRAIL = (120, 200, 120, 255)
TARGET = (255, 71, 190, 255)
FOOTPRINT = (0, 214, 201, 255)
WALL = (255, 60, 60, 255)
SLOW = (255, 190, 50, 255)
AREA = (150, 150, 165, 255)
RACK = (196, 120, 255, 255)
DETECTED = (255, 214, 64, 255)
OCCUPIED, FREE = (196, 120, 255, 255), (90, 200, 120, 255)
NAME: Colour = (60, 140, 255, 255)  # legible on dark and on light
# Curves: what is measured, what was wanted, and other things beside them.
FIRST, SECOND, THIRD, FOURTH = (78, 161, 255, 255), (255, 146, 43, 255), (64, 192, 87, 255), (250, 82, 110, 255)
# Curves that come in sixes and sevens: one a joint, base to flange; one a service.
SERIES: tuple[Colour, ...] = (
    (78, 121, 255, 255),
    (255, 146, 43, 255),
    (64, 192, 87, 255),
    (250, 82, 110, 255),
    (190, 120, 255, 255),
    (34, 200, 214, 255),
    (200, 200, 90, 255),
)
