"""How results are told: Markdown tables, medians, and ratios within one run."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Report:
    """One benchmark's result. ``remarks`` say how it was measured and what limits it."""

    title: str
    command: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]
    remarks: str

    def markdown(self) -> str:
        lines = [f"## {self.title}", "", f"`{self.command}`", "", _line(self.header), _line(["---"] * len(self.header))]
        lines += [_line(row) for row in self.rows]
        return "\n".join([*lines, "", self.remarks, ""])


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def median(values: Sequence[float]) -> float:
    return statistics.median(values)


def percentile(values: Sequence[float], share: float) -> float:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
