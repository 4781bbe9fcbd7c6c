"""Compilation of hot loops, typed: a compiled function keeps the signature it is written with."""

from __future__ import annotations

from collections.abc import Callable
from typing import ParamSpec, TypeVar, cast

from numba import njit

P = ParamSpec("P")
R = TypeVar("R")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Machine code at the first call, kept on disk beside the module for the next process."""
    return cast("Callable[P, R]", njit(cache=True)(function))
