"""The scores of all runs as an SVG: a bar a world, the worst first, and what each lost its score by."""

from __future__ import annotations

from collections.abc import Sequence

from benchmarks.barn.score import BEST, Result, cause

WIDTH, HEIGHT, LEFT, BELOW = 960, 320, 50, 40
COLOURS = {
    "": "#5b9a68", "contact": "#b3261e", "not arrived": "#d9822b", "stands": "#7a5195", "creeps": "#3d6fb4",
    "drives slowly": "#6fa8dc", "long way": "#999999",
}  # fmt: skip


def plot(results: Sequence[Result]) -> str:
    """The SVG's text."""
    ordered = sorted(results, key=lambda result: (result.score, -result.ratio))
    step = (WIDTH - LEFT) / max(len(ordered), 1)
    scale = (HEIGHT - BELOW - 20) / BEST
    bars = [
        f'<rect x="{LEFT + k * step:.2f}" y="{HEIGHT - BELOW - r.score * scale:.2f}" '
        f'width="{max(step - 0.5, 0.5):.2f}" '
        f'height="{max(r.score * scale, 1.0):.2f}" fill="{COLOURS[cause(r)]}"><title>world {r.world}: {r.score:.3f}, '
        f"AT/OT {r.ratio:.2f}{', ' + cause(r) if cause(r) else ''}</title></rect>"
        for k, r in enumerate(ordered)
    ]
    ticks = [
        f'<text x="{LEFT - 6}" y="{HEIGHT - BELOW - value * scale + 4:.1f}" text-anchor="end">{value:.1f}</text>'
        for value in (0.0, 0.1, 0.2, 0.3, 0.4, 0.5)
    ]
    keys = [
        f'<rect x="{LEFT + k * 125}" y="{HEIGHT - 18}" width="10" height="10" fill="{colour}"/>'
        f'<text x="{LEFT + k * 125 + 14}" y="{HEIGHT - 9}">{name or "nothing lost"}</text>'
        for k, (name, colour) in enumerate(COLOURS.items())
    ]
    mean = sum(r.score for r in results) / max(len(results), 1)
    title = f'<text x="{LEFT}" y="14">BARN, {len(results)} worlds, score {mean:.4f} of {BEST}</text>'
    size = f'width="{WIDTH}" height="{HEIGHT}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="11">'
    return "\n".join([head, title, *ticks, *bars, *keys, "</svg>"]) + "\n"
