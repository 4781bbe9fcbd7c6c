"""The web pages: every file they name is served, all they write to is there, and nothing comes from elsewhere."""

from __future__ import annotations

import re
from importlib.resources import files

import pytest

from rackhand.services.gateway.http import docs
from rackhand.services.gateway.page import index
from rackhand.services.gateway.settings import Settings
from rackhand.services.gateway.ws.payloads import PAYLOADS
from tests.gateway.harness import Gateway, running_gateway

PAGE = files("rackhand.services.gateway") / "page"
TEXTS = {entry.name: entry.read_text("utf-8") for entry in PAGE.iterdir()}
SCRIPTS = "".join(text for name, text in TEXTS.items() if name.endswith(".js"))
HTML = TEXTS["index.html"]
BROWSER = {"accept": "text/html,application/xhtml+xml,*/*;q=0.8"}


def loaded_by(html: str) -> set[str]:
    """What a page loads: its scripts, styles, icons."""
    return set(re.findall(r'<(?:script|link|img|iframe)\b[^>]*\b(?:src|href)="([^"]+)"', html)) - {"data:,"}


def test_the_page_listens_to_topics_that_exist() -> None:
    listened = set(re.findall(r'"(/[a-z_/0-9]+)": "', TEXTS["wire.js"]))
    assert len(listened) > 10
    assert listened <= set(PAYLOADS)


def test_every_element_the_scripts_write_to_is_on_the_page() -> None:
    written = set(re.findall(r'\b(?:at|show|hide|dress|badge|fill)\("([a-z-]+)"', SCRIPTS))
    assert len(written) > 20
    assert written <= set(re.findall(r'id="([a-z-]+)"', HTML))


def test_every_colour_the_map_is_drawn_in_is_in_the_style_twice() -> None:
    """In light and in dark."""
    named = re.search(r"const COLOURS = \[(.*?)\]", SCRIPTS, re.DOTALL)
    assert named is not None
    for name in re.findall(r'"([a-z]+)"', named[1]):
        assert len(re.findall(rf"--map-{name}: #", TEXTS["page.css"])) == 2, name


def test_every_file_of_the_page_is_served_and_none_fetches_from_elsewhere(gateway: Gateway) -> None:
    for name, text in TEXTS.items():
        assert not re.search(r"https?://", text), name
        for referred in re.findall(r'from "\./([a-z.]+)"', text):
            assert referred in index.ASSETS
    answer = gateway.http.get("/", headers=BROWSER)
    assert answer.text == HTML
    for path in loaded_by(HTML) | {f"/page/{name}" for name in index.ASSETS}:
        asset = gateway.http.get(path)
        assert asset.text == TEXTS[path.removeprefix("/page/")]
        assert asset.headers["content-type"] in ("text/javascript; charset=utf-8", "text/css; charset=utf-8")


def test_the_documentation_comes_whole_from_here(gateway: Gateway) -> None:
    html = gateway.http.get("/docs", headers=BROWSER).text
    assert not re.search(r"(?:https?:)?//[a-z]", html)
    assert loaded_by(html) == {f"/docs/{name}" for name in docs.ASSETS}
    for name in docs.ASSETS:
        asset = gateway.http.get(f"/docs/{name}")
        assert asset.status_code == 200
        assert asset.content == (files("fastapi_swagger") / "resources" / name).read_bytes()
    styles = gateway.http.get("/docs/swagger-ui.css").text
    assert not re.search(r"url\([\"']?(?!data:)[^\"']", styles)
    assert not re.search(r"@import", styles)


@pytest.mark.parametrize("path", ["/", "/docs"])
def test_browsers_are_reported_to_load_nothing_from_elsewhere(gateway: Gateway, path: str) -> None:
    policy = gateway.http.get(path, headers=BROWSER).headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert not re.search(r"https?:|\*|script-src[^;]*unsafe", policy)


@pytest.mark.parametrize("path", ["/page/page.html", "/page/..%2fapp.py", "/docs/__init__.py", "/docs/..%2fmain.py"])
def test_no_other_file_is_served(gateway: Gateway, path: str) -> None:
    assert gateway.http.get(path).status_code == 404


def test_pages_open_without_the_secret_and_tell_nothing_of_the_robot() -> None:
    """A browser cannot send the header before it has the page, which then brings the secret from its own URL."""
    with running_gateway(Settings(secret="s", planning_state_timeout=0)) as gateway:
        for path in ("/", "/page/page.js", "/docs", "/docs/swagger-ui.css", "/openapi.json"):
            assert gateway.http.get(path, headers=BROWSER).status_code == 200
        assert gateway.http.get("/chassis/moves", headers=BROWSER).status_code == 401
