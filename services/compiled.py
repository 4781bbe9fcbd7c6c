"""Compilation of hot loops, for every service that has some.

Machine code is made at a function's first call and kept on disk beside its module, so that the next process has it at
once. numba keeps it as long as the function's own file stays as it is, even where a function it calls has changed in
another: here it is kept only while every module of the folder, and of those below it, stays as it is.

`NUMBA_DISABLE_JIT=1` runs everything as plain Python.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


def compiled(function: F) -> F:
    """The function as machine code; it may call others of its folder and of those below it. Typed as it is written."""
    dispatcher = njit(cache=True)(function)
    if not inspect.isfunction(dispatcher):
        kept = dispatcher._cache._cache_file
        kept._source_stamp = (kept._source_stamp, _stamp_of(Path(inspect.getfile(function)).parent))
    return cast("F", dispatcher)


@cache
def _stamp_of(folder: Path) -> str:
    """Changes with any module of the folder and of those below it."""
    stamp = hashlib.blake2b(digest_size=16)
    for module in sorted(folder.rglob("*.py")):
        stamp.update(module.name.encode() + b"\0" + module.read_bytes())
    return stamp.hexdigest()
