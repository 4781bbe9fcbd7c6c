"""The table of a sweep: one row a run, written as runs end, so that a sweep that was stopped goes on where it was."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any

from rackhand.scenarios.sweep import Point, settings_text
from rackhand.scenarios.verdicts import Verdict

END = b"\r\n"  # of a row, as the csv module writes it; texts in it have \n alone
COLUMNS = (
    "scenario",
    "seed",
    "settings",
    "world",
    "passed",
    "state",
    "fail_reason",
    "reason",
    "took",
    "contacts",
    "simulated",
    "wall",
    "fail_message",
    "problems",
)


@dataclass(frozen=True)
class Row:
    """What a summary needs of a run. ``took``: seconds of simulation time, None if the move did not end in time."""

    scenario: str
    seed: int
    settings: str
    passed: bool
    reason: str
    took: float | None
    problems: str


class Results:
    """``results.csv`` in a folder. A context manager: the file is open while rows are added."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "results.csv"
        folder.mkdir(parents=True, exist_ok=True)

    def __enter__(self) -> Results:
        self._drop_cut_off_row()
        fresh = not self.path.exists() or self.path.stat().st_size == 0
        self._file = self.path.open("a", newline="", encoding="utf-8")
        self._rows = csv.DictWriter(self._file, COLUMNS)
        if fresh:
            self._rows.writeheader()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def _drop_cut_off_row(self) -> None:
        """A process that was killed may have written a part of its last row."""
        if self.path.exists() and not (content := self.path.read_bytes()).endswith(END):
            self.path.write_bytes(content[: content.rfind(END) + len(END)] if END in content else b"")

    def add(self, point: Point, verdict: Verdict) -> None:
        """On disk when this returns."""
        content = verdict.as_json() | {"reason": verdict.reason_name, "settings": settings_text(point.settings)}
        content["problems"] = "; ".join(verdict.problems)
        content["took"] = "" if verdict.took is None else f"{verdict.took:.3f}"
        self._rows.writerow({column: content[column] for column in COLUMNS})
        self._file.flush()

    def left(self, todo: Sequence[Point]) -> list[Point]:
        """Those that have no row yet."""
        done = {(row["scenario"], row["seed"], row["settings"]) for row in self._read()}
        return [point for point in todo if point.key not in done]

    def rows(self) -> list[Row]:
        return [
            Row(
                scenario=row["scenario"],
                seed=int(row["seed"]),
                settings=row["settings"],
                passed=row["passed"] == "True",
                reason=row["reason"],
                took=float(row["took"]) if row["took"] else None,
                problems=row["problems"],
            )
            for row in self._read()
        ]

    def write_parquet(self) -> Path | None:
        """The same table as ``results.parquet``; None where pyarrow is not installed."""
        if find_spec("pyarrow") is None:
            return None
        from pyarrow import csv as arrow_csv
        from pyarrow import parquet

        path = self.path.with_suffix(".parquet")
        parquet.write_table(arrow_csv.read_csv(self.path), path)
        return path

    def _read(self) -> Iterable[dict[str, Any]]:
        """Without a last row that was cut off."""
        if not self.path.exists():
            return []
        with self.path.open(newline="", encoding="utf-8") as file:
            return [row for row in csv.DictReader(file) if None not in row.values()]
