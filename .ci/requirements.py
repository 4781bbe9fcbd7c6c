"""Prints the requirements of the services' images, one a line: what a wheelhouse for an offline build must hold."""

from __future__ import annotations

import tomllib
from pathlib import Path

IMAGES = ("sim", "planner", "controller", "gateway", "viewer")


def main() -> None:
    pyproject = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())
    project = pyproject["project"]
    extras = [line for extra in IMAGES for line in project["optional-dependencies"][extra]]
    print(*dict.fromkeys([*pyproject["build-system"]["requires"], *project["dependencies"], *extras]), sep="\n")


if __name__ == "__main__":
    main()
