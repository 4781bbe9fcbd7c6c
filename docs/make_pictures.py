"""Renews the pictures of the documentation, from a cell that really runs: ``python -m docs.make_pictures``."""

from __future__ import annotations

import tempfile
from pathlib import Path

import httpx
from playwright.sync_api import expect

from tests.gateway.browser import browser, wait_until
from tests.system.cell import Cell

PAGE = Path(__file__).with_name("page.png")
MOVE = {"creator": "docs", "type": "standard", "target_x": 15.0, "target_y": 10.3, "target_ori": 0.0}
PATIENCE = 120_000  # ms


def main() -> None:
    with tempfile.TemporaryDirectory() as folder, Cell(Path(folder), "--world", "warehouse", "--speed", "1") as cell:
        take_page(cell.http, PAGE)
    print(f"{PAGE}: {PAGE.stat().st_size // 1024} KiB")


def take_page(url: str, picture: Path) -> None:
    """The page, while the robot is half way."""
    with browser() as chromium:
        page = chromium.new_page(viewport={"width": 1200, "height": 740}, device_scale_factor=1.5, locale="en-GB")
        page.goto(url)
        expect(page.locator("#link")).to_have_text("live", timeout=PATIENCE)
        httpx.post(f"{url}/chassis/moves", json=MOVE, timeout=PATIENCE / 1000, trust_env=False).raise_for_status()
        wait_until(page, "document.getElementById('move-progress').value > 0.45")
        page.screenshot(path=picture)


if __name__ == "__main__":
    main()
