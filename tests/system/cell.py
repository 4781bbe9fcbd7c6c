"""Where this repository is, for tests that read its files; cells come from ``rackhand.testing``."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).parents[2]
