"""A hook of MkDocs: links to files of the repository outside ``docs/`` are shown as their names, since the site does
not have these files. On GitHub they are links.
"""

from __future__ import annotations

import re
from typing import Any

OUTSIDE = re.compile(r"(?<!!)\[([^\]]+)\]\(\.\./[^)]+\)")


def on_page_markdown(markdown: str, **_: Any) -> str:
    return OUTSIDE.sub(r"\1", markdown)
