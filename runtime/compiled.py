"""Compilation of hot loops, for the services that have some.

A function is compiled at its first call, and the machine code is cached on disk beside its module, so that the next
process loads it. numba invalidates that cache only when the function's own file changes, not when a function that it
calls changes in another file: here it is also invalidated when any module changes that the function's module imports,
directly or not.

`NUMBA_DISABLE_JIT=1` runs everything as plain Python.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])
_dispatchers: list[Any] = []


def compiled(function: F) -> F:
    """The function, compiled. It may call other compiled functions that its module imports from this project."""
    return _compiled(function)


def compiled_nogil(function: F) -> F:
    """As ``compiled``, and it releases the interpreter while it runs: for what takes milliseconds in a worker thread,
    so that the control loop's thread goes on meanwhile. Its arguments must not change until it returns."""
    return _compiled(function, nogil=True)


def inlined(function: F) -> F:
    """As ``compiled``, and copied into each compiled function that calls it: for small functions in inner loops.

    A call that passes arrays in a NamedTuple costs two atomic reference counts an array, and the exception of a
    division by 0 keeps LLVM from removing them: here a division by 0 gives infinity or NaN, as in numpy.
    """
    return _compiled(function, forceinline=True, error_model="numpy")


def ready_functions() -> tuple[int, int]:
    """How many of the functions of this process have machine code, compiled or loaded, and how many there are.

    Where a function was loaded from the cache, those that only it calls are not counted: they are part of its code.
    """
    return sum(bool(dispatcher.signatures) for dispatcher in _dispatchers), len(_dispatchers)


def _compiled(function: F, **options: Any) -> F:
    dispatcher = njit(cache=True, **options)(function)
    if not inspect.isfunction(dispatcher):
        _dispatchers.append(dispatcher)
        kept = dispatcher._cache._cache_file
        kept._source_stamp = (kept._source_stamp, _stamp_of(Path(inspect.getfile(function)), function.__module__))
    return cast("F", dispatcher)


@cache
def _stamp_of(file: Path, module: str) -> str:
    """Changes with the file and with every module of this project that it imports, directly or not."""
    sources, unread = {file}, [file]
    while unread:
        for imported in _imports(unread.pop(), module):
            if imported not in sources:
                sources.add(imported)
                unread.append(imported)
    stamp = hashlib.blake2b(digest_size=16)
    for source in sorted(sources):
        stamp.update(source.name.encode() + b"\0" + source.read_bytes())
    return stamp.hexdigest()


@cache
def _imports(file: Path, importer: str) -> tuple[Path, ...]:
    """Files of the modules that ``file`` imports and that belong to the project of the module ``importer``."""
    project = importer.partition(".")[0]
    files = []
    for name in _imported_names(ast.parse(file.read_bytes())):
        source = getattr(sys.modules.get(name), "__file__", None)
        if source and (name.partition(".")[0] == project or Path(source).parent == file.parent):
            files.append(Path(source))
    return tuple(files)


def _imported_names(tree: ast.Module) -> Iterator[str]:
    """Of the imports at the top of a module: what compiled code refers to is imported there."""
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
