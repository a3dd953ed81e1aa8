"""Compiles functions with numba and caches the machine code on disk.

Every compiled function is ordinary Python on numpy arrays: with ``NUMBA_DISABLE_JIT=1``, or without numba, the same
source runs uncompiled. The tests compare the two.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from importlib import import_module
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

REORDERING_FLAGS = {"reassoc", "contract", "nsz", "arcp"}

log = logging.getLogger("extractor")

numba: Any
try:
    numba = import_module("numba")
except ImportError:  # slow, with the same results
    numba = None


def compiled(function: Function) -> Function:
    """Compile ``function`` with numba on its first call; the result is cached beside its source file."""
    return _jit(function, False)


def vectorized(function: Function) -> Function:
    """As ``compiled``, for loops whose sums may be reordered, so that several terms are added at once.

    NaN and infinity keep their meaning.
    """
    return _jit(function, REORDERING_FLAGS)


def inlined(function: Function) -> Function:
    """As ``compiled``, inlined into the caller: a call with a few arrays costs as much as a hundred additions."""
    return _jit(function, False, forceinline=True)


def inlined_no_refcount(function: Function) -> Function:
    """As ``inlined``, for functions that neither create nor return arrays: references to arrays are not counted.

    Each row or slice of an array is otherwise counted until it is dropped, by locked writes: a large part of the time
    of a loop that takes slices for every item.
    """
    return _jit(function, False, forceinline=True, _nrt=False)


def compiled_no_refcount(function: Function) -> Function:
    """As ``inlined_no_refcount``, for functions too long to be inlined."""
    return _jit(function, False, _nrt=False)


def vectorized_no_refcount(function: Function) -> Function:
    """As ``inlined_no_refcount``, for loops whose sums may be reordered."""
    return _jit(function, REORDERING_FLAGS, forceinline=True, _nrt=False)


def _jit(function: Function, fastmath: bool | set[str], **more: bool) -> Function:
    if numba is None:
        return function
    options = {"cache": True, "nogil": True, "error_model": "numpy", **more}
    kernel: Function = numba.njit(**options, fastmath=fastmath)(function)
    return kernel


def _announce_compilation() -> None:
    """Log one warning when code of this package is compiled."""
    event = import_module("numba.core.event")

    class Announcer(event.Listener):  # type: ignore[misc, name-defined]
        is_announced = False

        def on_start(self, happening: Any) -> None:
            dispatcher = happening.data["dispatcher"]
            if not self.is_announced and dispatcher.py_func.__module__.startswith("extractor."):
                self.is_announced = True
                log.warning(
                    "compiling for this machine; the first use takes about two minutes, later ones are cached"
                )

        def on_end(self, happening: Any) -> None:
            pass

    event.register("numba:compile", Announcer())


if numba is not None:
    _announce_compilation()
