"""Prints the requirements of some extras of the project, one a line: what an image of one service installs.

example: python docker/requirements.py core sim
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path


def main(extras: list[str]) -> None:
    """``extras``: names of optional dependencies. None: all of them, and what a build needs (for a wheelhouse)."""
    pyproject = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())
    known: dict[str, list[str]] = pyproject["project"]["optional-dependencies"]
    if unknown := set(extras) - known.keys():
        sys.exit(f"requirements.py: unknown extras {sorted(unknown)}; known: {sorted(known)}")
    build = [] if extras else pyproject["build-system"]["requires"]
    chosen = extras or [name for name in known if name not in ("bench", "dev", "docs", "testing")]
    print(*dict.fromkeys([*build, *(line for extra in chosen for line in known[extra])]), sep="\n")


if __name__ == "__main__":
    main(sys.argv[1:])
