"""The web page: every file it names is served, all it writes to is there, and nothing comes from elsewhere."""

from __future__ import annotations

import re
from importlib.resources import files

from services.gateway.index import _ASSETS
from services.gateway.topics import PAYLOADS

PAGE = files("services.gateway") / "page"
HTML = (PAGE / "index.html").read_text("utf-8")
SCRIPT = (PAGE / "page.js").read_text("utf-8")


def test_the_page_listens_to_topics_that_exist() -> None:
    listened = set(re.findall(r'"(/[a-z_/0-9]+)": "', SCRIPT))
    assert len(listened) > 10
    assert listened <= set(PAYLOADS)


def test_every_element_the_script_writes_to_is_on_the_page() -> None:
    written = set(re.findall(r'\b(?:at|show|badge|list)\("([a-z-]+)"', SCRIPT))
    assert len(written) > 15
    assert written <= set(re.findall(r'id="([a-z-]+)"', HTML))


def test_every_file_of_the_page_is_served_and_none_fetches_from_elsewhere() -> None:
    for name in [entry.name for entry in PAGE.iterdir()]:
        text = (PAGE / name).read_text("utf-8")
        assert not re.search(r"https?://", text), name
        assert name == "index.html" or name in _ASSETS
        for referred in re.findall(r'(?:from "\./|/page/)([a-z.]+)"', text):
            assert referred in _ASSETS
