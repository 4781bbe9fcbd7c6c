"""Worlds of a test's own: written into a worlds folder, with their map."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import yaml

from rackhand.services.sim.world.maps import write_map
from rackhand.worlds.data import WORLDS_PATH
from rackhand.worlds.world_model import World

Json = dict[str, Any]


def write_place(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    bounds: tuple[float, float, float, float],
    statics: Json | None = None,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    profile: str = "longjack",
) -> str:
    """A world with one robot ``amr1``; its name. ``bounds``: left, lower, right, upper in metres, without walls."""
    description = {
        "version": 1,
        "name": name,
        "bounds": list(bounds),
        "robots": {"amr1": {"profile": profile, "pose": list(start), "battery": 0.8}},
        "statics": statics or {},
    }
    monkeypatch.setenv(WORLDS_PATH, str(folder))
    write_map(World.model_validate(description), folder / name)
    (folder / name / "world.yaml").write_text(yaml.safe_dump(description))
    return name
