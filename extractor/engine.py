"""Compiles the loops that plain Python is too slow for, once, and caches the machine code on disk.

Every compiled function is ordinary Python on numpy arrays: with ``NUMBA_DISABLE_JIT=1`` (or without numba) the
same source runs uncompiled, which is the twin that the tests compare against.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

try:
    import numba
except ImportError:  # slow, but right
    numba = None


def compiled(function: Function) -> Function:
    """Compile ``function`` with numba on its first call; the result is cached beside its source file."""
    if numba is None:
        return function
    return numba.njit(cache=True, nogil=True, error_model="numpy")(function)  # type: ignore[no-any-return]
