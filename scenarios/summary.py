"""The HTML summary of a sweep: for each scenario and settings how many runs passed, and how long the moves took."""

from __future__ import annotations

import html
import statistics
from collections import Counter
from collections.abc import Sequence
from itertools import groupby

from rackhand.scenarios.results import Row

WIDTH, HEIGHT, RIM = 420, 120, 18  # px of a plot
BINS = 24
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2em auto; max-width: 60em; padding: 0 1em; }
table { border-collapse: collapse; } th, td { padding: .2em .8em .2em 0; text-align: left; vertical-align: top; }
tr { border-bottom: 1px solid #ddd; } .bad { color: #a00; } rect { fill: #4a76a8; } text { font-size: 11px; }
"""


def summary(rows: Sequence[Row]) -> str:
    """A page without scripts and without anything from elsewhere."""
    ordered = sorted(rows, key=lambda row: (row.scenario, row.settings))
    groups = [(key, list(group)) for key, group in groupby(ordered, lambda row: (row.scenario, row.settings))]
    longest = max((row.took for row in rows if row.took is not None), default=1.0)
    passed = sum(row.passed for row in rows)
    parts = [
        f'<!doctype html><html lang="en"><meta charset="utf-8"><title>Sweep</title><style>{STYLE}</style>',
        f"<h1>Sweep</h1><p>{len(rows)} runs, {passed} passed, {len(rows) - passed} not.</p>",
        "<table><tr><th>scenario</th><th>settings</th><th>passed</th><th>seconds: median, 95 %</th>"
        "<th>reasons</th><th>seconds that the move took</th></tr>",
        *(_row(scenario, settings, group, longest) for (scenario, settings), group in groups),
        "</table>",
        *_failures(ordered),
    ]
    return "\n".join(parts) + "\n"


def _row(scenario: str, settings: str, rows: Sequence[Row], longest: float) -> str:
    took = [row.took for row in rows if row.took is not None]
    passed = sum(row.passed for row in rows)
    reasons = ", ".join(f"{name} {count}" for name, count in Counter(row.reason for row in rows).most_common())
    times = f"{statistics.median(took):.1f}, {percentile(took, 0.95):.1f}" if took else "–"
    mark = "" if passed == len(rows) else ' class="bad"'
    cells = (html.escape(scenario), html.escape(settings) or "–", f"<span{mark}>{passed} of {len(rows)}</span>", times)
    plot = histogram(took, longest) if took else ""
    return "<tr>" + "".join(f"<td>{cell}</td>" for cell in (*cells, html.escape(reasons), plot)) + "</tr>"


def percentile(values: Sequence[float], share: float) -> float:
    """The smallest of the values that at least that share of them does not exceed."""
    ordered = sorted(values)
    return ordered[max(0, -int(-share * len(ordered) // 1) - 1)]


def histogram(values: Sequence[float], longest: float) -> str:
    """An SVG of how many values are in each of ``BINS`` parts of 0 … ``longest``."""
    counts = Counter(min(int(value / longest * BINS), BINS - 1) for value in values)
    highest, step = max(counts.values()), (WIDTH - 2 * RIM) / BINS
    bars = "".join(
        f'<rect x="{RIM + place * step:.1f}" y="{HEIGHT - RIM - count / highest * (HEIGHT - 2 * RIM):.1f}" '
        f'width="{step - 1:.1f}" height="{count / highest * (HEIGHT - 2 * RIM):.1f}"/>'
        for place, count in sorted(counts.items())
    )
    axis = (
        f'<line x1="{RIM}" x2="{WIDTH - RIM}" y1="{HEIGHT - RIM}" y2="{HEIGHT - RIM}" stroke="#888"/>'
        f'<text x="{RIM}" y="{HEIGHT - 4}">0 s</text>'
        f'<text x="{WIDTH - RIM}" y="{HEIGHT - 4}" text-anchor="end">{longest:.1f} s</text>'
        f'<text x="{RIM}" y="{RIM - 5}">{highest} runs</text>'
    )
    return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" role="img">{bars}{axis}</svg>'


def _failures(rows: Sequence[Row]) -> list[str]:
    failed = [row for row in rows if not row.passed]
    if not failed:
        return []
    lines = [
        f"<tr><td>{html.escape(row.scenario)}</td><td>{row.seed}</td><td>{html.escape(row.settings)}</td>"
        f"<td>{html.escape(row.problems)}</td></tr>"
        for row in failed
    ]
    header = "<tr><th>scenario</th><th>seed</th><th>settings</th><th>what was not as expected</th></tr>"
    return ["<h2>Runs that did not pass</h2><table>", header, *lines, "</table>"]
