"""How results are told: Markdown tables, medians, and ratios within one run."""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

Rows = Sequence[Sequence[str]]


@dataclass(frozen=True)
class Table:
    """A further table of a report, under a heading of its own."""

    title: str
    header: Sequence[str]
    rows: Rows
    remarks: str = ""

    def markdown(self) -> str:
        return "\n".join([f"### {self.title}", "", *_table(self.header, self.rows), "", *_closing(self.remarks)])


@dataclass(frozen=True)
class Report:
    """One benchmark's result. ``remarks`` say how it was measured and what limits it; ``more`` tables follow them."""

    title: str
    command: str
    header: Sequence[str]
    rows: Rows
    remarks: str
    more: Sequence[Table] = ()

    def markdown(self) -> str:
        head = [f"## {self.title}", "", f"`{self.command}`", "", *_table(self.header, self.rows), ""]
        return "\n".join([*head, *_closing(self.remarks), *(table.markdown() for table in self.more)])


def _table(header: Sequence[str], rows: Rows) -> list[str]:
    return [_line(header), _line(["---"] * len(header)), *(_line(row) for row in rows)]


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _closing(remarks: str) -> list[str]:
    return [remarks, ""] if remarks else []


def median(values: Sequence[float]) -> float:
    return statistics.median(values)


def percentile(values: Sequence[float], share: float) -> float:
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]
