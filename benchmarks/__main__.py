"""``python -m benchmarks [NAME …]``: run benchmarks and print their tables; ``--write`` puts them into the docs."""

from __future__ import annotations

import argparse
import dataclasses
import importlib
import re
from pathlib import Path
from types import ModuleType
from typing import Any

from benchmarks.progress import shown

PAGE = Path(__file__).parent.parent / "docs" / "benchmarks.md"
NAMES = (
    "align",
    "barn",
    "bus",
    "cell",
    "demo",
    "operations",
    "encounters",
    "first_motion",
    "follow",
    "goals",
    "random_goals",
    "planning",
    "planner_tick",
    "rack_jobs",
    "rack_hour",
    "carrying",
    "routes",
    "lift",
    "ik",
    "motion",
    "contact",
    "clearance",
    "picks",
    "trajectory",
    "viewer",
    "viewer_memory",
    "watchers",
)


def main() -> None:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Run benchmarks and print their tables.",
        epilog="example: python -m benchmarks bus --write",
    )
    parser.add_argument("names", nargs="*", help=f"which: {', '.join(NAMES)} (all if none is named)")
    parser.add_argument("--write", action="store_true", help=f"replace these sections of docs/{PAGE.name}")
    some = parser.add_argument_group("benchmarks that take long")
    some.add_argument("--data", type=Path, help="barn: file of the worlds (those of the repository if none is named)")
    some.add_argument("--worlds", type=int, help="barn: drive so many of them, evenly spread (all if none is named)")
    some.add_argument(
        "--in-process", action="store_true", default=None, help="barn: in one process instead of a cell for each world"
    )
    some.add_argument("--count", type=int, help="encounters: so many of them, from the first on (200 if none is named)")
    some.add_argument(
        "--minutes", type=int, help="random_goals, rack_hour: so many of simulation (120, 60 if none is named)"
    )
    some.add_argument(
        "--variant",
        choices=("undisturbed", "interrupted", "people"),
        help="rack_hour: this one only (each if none is named)",
    )
    some.add_argument(
        "--results",
        type=Path,
        help="barn, encounters, random_goals, rack_hour: file from which a run goes on (NAME-results.jsonl)",
    )
    arguments = parser.parse_args()
    if unknown := set(arguments.names) - set(NAMES):
        parser.error(f"no benchmark {', '.join(sorted(unknown))}; there are {', '.join(NAMES)}")
    for name in arguments.names or NAMES:
        module = importlib.import_module(f"benchmarks.{name}")
        with shown(name):
            report = module.run(_options(module, arguments)) if hasattr(module, "Options") else module.run()
        text = report.markdown()
        print(text, flush=True)
        if arguments.write:
            write_section(text)


def _options(module: ModuleType, arguments: argparse.Namespace) -> Any:
    """The module's ``Options`` with what was given of them."""
    names = [field.name for field in dataclasses.fields(module.Options)]
    given = {name: value for name in names if (value := getattr(arguments, name, None)) is not None}
    return module.Options(**given)


def write_section(text: str) -> None:
    """Replace the section of the same heading, or append it."""
    page = PAGE.read_text()
    heading = text.splitlines()[0]
    section = re.compile(rf"^{re.escape(heading)}$.*?(?=^## |\Z)", re.MULTILINE | re.DOTALL)
    replaced = section.sub(lambda _: text + "\n", page) if section.search(page) else f"{page.rstrip()}\n\n{text}"
    PAGE.write_text(replaced.rstrip() + "\n")


if __name__ == "__main__":
    main()
