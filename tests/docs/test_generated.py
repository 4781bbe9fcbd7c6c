"""The generated tables and files are those that the contract gives now."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rackhand.services.gateway.reference import page as all_calls
from rackhand.services.launch.reference import BLOCKS, files, refresh

ROOT = Path(__file__).parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_generated_tables_are_fresh(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert refresh(text) == text, "run `make docs`"


@pytest.mark.parametrize("name", files())
def test_generated_files_are_fresh(name: str) -> None:
    assert (ROOT / "docs" / name).read_text(encoding="utf-8") == files()[name](), "run `make docs`"


def test_the_page_of_all_calls_is_fresh() -> None:
    assert (ROOT / "docs" / "http.md").read_text(encoding="utf-8") == all_calls(), "run `make docs`"


def test_every_table_is_shown_somewhere() -> None:
    shown = {name for page in PAGES for name in re.findall(r"<!-- generated: ([a-z-]+) -->", page.read_text())}
    assert shown == set(BLOCKS)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        if not target.startswith(("http://", "https://")):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
