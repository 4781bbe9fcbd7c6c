"""Draws the diagrams of the explanations, as SVG: ``python -m docs.make_diagrams``. Standard library only."""

from __future__ import annotations

import math
from pathlib import Path

FOLDER = Path(__file__).parent
STYLE = """
  .box { fill: #ffffff; stroke: #334155; stroke-width: 1.5 } .blue { fill: #dbeafe; stroke: #2563eb; stroke-width: 1.5 }
  .grey { fill: #f1f5f9; stroke: #94a3b8 } .red { fill: #fee2e2; stroke: #dc2626; stroke-width: 1.5 }
  .green { fill: #dcfce7; stroke: #16a34a; stroke-width: 1.5 } .line { stroke: #475569; stroke-width: 1.5; fill: none }
  .thick { stroke: #2563eb; stroke-width: 2.5; fill: none } .dash { stroke: #64748b; stroke-dasharray: 5 4; fill: none }
  .arrow { stroke: #475569; stroke-width: 1.5; fill: none; marker-end: url(#tip) }
  .name { font-weight: 600; fill: #0f172a } .note { fill: #475569; font-size: 12px } .mid { text-anchor: middle }
"""
TIP = (
    '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
    '<path d="M0 0 L8 4 L0 8 z" fill="#475569"/></marker>'
)


class Drawing:
    """An SVG under construction: x to the right and y down, in pixels."""

    def __init__(self, width: int, height: int, title: str) -> None:
        self._size, self._title, self._parts = (width, height), title, list[str]()

    def box(self, kind: str, x: float, y: float, w: float, h: float, text: str = "") -> None:
        self._parts.append(f'<rect class="{kind}" x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" rx="6"/>')
        if text:
            self.text(x + w / 2, y + h / 2 + 5, text, "note mid")

    def text(self, x: float, y: float, text: str, kind: str = "note") -> None:
        self._parts.append(f'<text class="{kind}" x="{x:g}" y="{y:g}">{text}</text>')

    def path(self, kind: str, *points: tuple[float, float], close: bool = False) -> None:
        corners = " L".join(f"{x:.1f} {y:.1f}" for x, y in points)
        self._parts.append(f'<path class="{kind}" d="M{corners}{" z" if close else ""}"/>')

    def dot(self, x: float, y: float, radius: float, colour: str) -> None:
        self._parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" fill="{colour}"/>')

    def write(self, name: str) -> None:
        width, height = self._size
        font = 'font-family="system-ui, \'Segoe UI\', Helvetica, Arial, sans-serif" font-size="14"'
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img" {font}>'
        ground = f'<rect width="{width}" height="{height}" rx="10" fill="#ffffff"/>'
        style = f"<title>{self._title}</title><defs>{TIP}<style>{STYLE}</style></defs>"
        (FOLDER / name).write_text("\n".join([head, style, ground, *self._parts, "</svg>"]) + "\n", encoding="utf-8")


def draw_lockstep() -> None:
    """Lanes of simulator and planner over wall-clock time."""
    d = Drawing(880, 300, "Lockstep with a latency of one period")
    for y, name in ((70, "simulator"), (190, "planner")):
        d.text(20, y + 30, name, "name")
        d.path("dash", (120, y + 25), (860, y + 25))
    steps = [(130, 130, "0 → 1"), (270, 130, "1 → 2"), (520, 130, "2 → 3"), (660, 130, "3 → 4")]
    for x, w, text in steps:
        d.box("blue", x, 70, w, 50, f"computes {text}")
    d.box("red", 405, 70, 110, 50, "waits for 1")
    for x, w, text in ((150, 90, "answers 0"), (290, 200, "answers 1, slowly"), (540, 90, "answers 2")):
        d.box("green", x, 190, w, 50, text)
    for x, text in ((135, "state 0"), (275, "state 1"), (525, "state 2")):
        d.path("arrow", (x, 120), (x + 17, 188))
        d.text(x + 16, 150, text)
    for x, to in ((240, 268), (490, 517), (630, 658)):
        d.path("arrow", (x, 190), (to, 122))
    d.text(130, 40, "the answer to state 0 takes effect at 1, the answer to state 1 at 2: latency of one period")
    d.text(120, 280, "wall-clock time →    a slow answer makes the simulator wait; in simulated time nothing changes")
    d.write("lockstep.svg")


def draw_access() -> None:
    """Three lanes: two clients and the arm."""
    d = Drawing(880, 300, "A client with a smaller number takes over")
    for y, name in ((40, "picker, 10"), (120, "operator, 5"), (200, "arm")):
        d.text(20, y + 30, name, "name")
        d.path("dash", (120, y + 25), (860, y + 25))
    d.box("blue", 140, 40, 200, 50, "holds: appendPath")
    d.box("red", 350, 40, 110, 50, "controlLost")
    d.box("blue", 690, 40, 150, 50, "may take it again")
    d.box("green", 345, 120, 325, 50)
    d.text(415, 150, "takes over, then holds: setVelocity …")
    for x, w, kind, text in (
        (150, 190, "blue", "drives the path"),
        (345, 90, "red", "brakes"),
        (440, 220, "green", "drives the velocity"),
        (665, 80, "red", "brakes"),
    ):
        d.box(kind, x, 200, w, 50, text)
    d.path("arrow", (400, 198), (400, 92))
    d.text(330, 280, "the queue is cleared; only at rest does the new command begin")
    d.text(610, 110, "unlockControl ↑")
    d.write("access.svg")


def draw_ik() -> None:
    """Velocity over position of one joint, with the braking curves √(2 a d)."""
    d = Drawing(880, 360, "The velocities that are allowed to a joint")
    left, right, middle, top = 90.0, 800.0, 180.0, 110.0
    acceleration = 60.0

    def braking(x: float, to: float) -> float:
        return min(top, math.sqrt(2 * acceleration * abs(to - x)))

    xs = [left + k * (right - left) / 200 for k in range(201)]
    upper = [(x, middle - braking(x, right)) for x in xs]
    lower = [(x, middle + braking(x, left)) for x in reversed(xs)]
    d.path("blue", *upper, *lower, close=True)
    d.path("arrow", (left - 30, middle), (right + 50, middle))
    d.path("arrow", (left - 30, 340), (left - 30, 30))
    d.text(right - 120, middle + 150, "position of the joint →")
    d.text(left - 60, 22, "velocity")
    d.text(left - 8, middle + 18, "lower end")
    d.text(right - 5, middle + 18, "upper end")
    x = 715.0
    y = middle - braking(x, right)
    d.box("red", x - 8, y, 16, 70)
    d.dot(x, y + 42, 4, "#0f172a")
    d.path("line", (x + 8, y + 42), (x + 62, y + 60))
    d.text(x - 20, middle - top - 38, "allowed in the next tick:")
    d.text(x - 20, middle - top - 22, "± a·Δt around now, and")
    d.text(x - 20, middle - top - 6, "below the braking curve")
    d.text(x + 66, y + 66, "now")
    d.text(330, middle - top - 10, "velocity limit")
    d.text(330, middle + top + 22, "velocity limit")
    d.text(330, middle - 42, "from everywhere in here the joint", "name")
    d.text(330, middle - 20, "can stop before its end", "name")
    d.write("ik.svg")


def draw_docking() -> None:
    """From above, 120 px a metre."""
    d = Drawing(880, 320, "Docking under a rack, from above")
    cx, cy, half = 640.0, 160.0, 100.0
    d.box("grey", cx - half, cy - half, 2 * half, 2 * half)
    d.text(cx, cy - half - 10, "rack", "name mid")
    d.path("green", (430, cy - 94), (cx + 94, cy - 94), (cx + 94, cy + 94), (430, cy + 94), close=True)
    d.text(440, cy + 86, "lane")
    corners = [(cx + sx * 82, cy + sy * 82) for sx in (-1, 1) for sy in (-1, 1)]
    for x, y in corners:
        d.box("box", x - 7, y - 7, 14, 14)
        d.path("dash", (372, cy), (x, y))
        for k in (-1, 0, 1):
            d.dot(x - 7, y + 4 * k, 1.8, "#dc2626")
    d.box("blue", 282, cy - 28, 90, 56, "robot")
    d.path("thick", (60, 285), (110, 240), (170, 195), (240, 166), (282, cy))
    d.path("arrow", (380, cy), (cx, cy))
    d.dot(cx, cy, 4, "#2563eb")
    d.text(282, cy - 40, "staging pose", "name")
    d.text(60, 306, "planned path")
    d.text(455, cy - 8, "approach along the axis")
    d.text(430, 306, "red: hits on the legs, from which the pose of the rack is fitted")
    d.write("docking.svg")


if __name__ == "__main__":
    for draw in (draw_lockstep, draw_access, draw_ik, draw_docking):
        draw()
