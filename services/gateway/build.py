"""From which commit the running code was made."""

from __future__ import annotations

import json
import os
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

COMMIT = "RACKHAND_COMMIT"  # set in images, which hold no repository
_GIT_TIMEOUT = 2.0  # s


@cache
def git_info() -> dict[str, str]:
    """``commit`` as a hash; empty where it is not known."""
    return {"commit": os.environ.get(COMMIT) or _installed_from() or _checked_out()}


def _installed_from() -> str:
    """The commit of an install from a repository (PEP 610)."""
    try:
        origin = json.loads(distribution("rackhand").read_text("direct_url.json") or "{}")
    except (PackageNotFoundError, ValueError):
        return ""
    return str(origin.get("vcs_info", {}).get("commit_id", ""))


def _checked_out() -> str:
    """The commit that is checked out where this file is, if it is in a checkout of rackhand."""
    folder = Path(__file__).resolve().parent
    command = ("git", "-C", str(folder), "rev-parse", "HEAD")
    try:
        tracked = subprocess.run(
            ("git", "-C", str(folder), "ls-files", "--error-unmatch", Path(__file__).name),
            capture_output=True,
            timeout=_GIT_TIMEOUT,
            check=False,
        )
        if tracked.returncode:
            return ""
        return subprocess.run(command, capture_output=True, text=True, timeout=_GIT_TIMEOUT, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""
