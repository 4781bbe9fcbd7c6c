"""Debian's Chromium for tests that look at pages, by Playwright, and talking to nobody but the page's own server."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

NAMES = ("chromium", "chromium-browser", "google-chrome")
QUIET = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def chromium() -> str | None:
    """Where it is; None where it is not installed."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


@contextmanager
def browser() -> Iterator[Browser]:
    """A browser. Without Chromium the test is skipped, but not in CI (environment variable ``CI``): there it fails."""
    path = chromium()
    if path is None and not os.environ.get("CI"):
        pytest.skip(f"none of {', '.join(NAMES)} is installed; on Debian: apt-get install chromium")
    assert path is not None, "in CI the page is looked at, and Chromium is not installed"
    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=path, args=list(QUIET))
        try:
            yield launched
        finally:
            launched.close()


def wait_until(page: Page, condition: str) -> None:
    """Until a JavaScript expression holds. ``page.wait_for_function`` would want a content policy that lets it eval."""
    page.evaluate(
        f"""() => new Promise((resolve) => {{
              const look = () => ({condition}) ? resolve() : requestAnimationFrame(look);
              look();
            }})"""
    )
