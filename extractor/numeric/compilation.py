"""Compiles the loops that plain Python is too slow for, once, and caches the machine code on disk.

Every compiled function is ordinary Python on numpy arrays: with ``NUMBA_DISABLE_JIT=1`` (or without numba) the
same source runs uncompiled, which is the twin that the tests compare against.
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
except ImportError:  # slow, but right
    numba = None


def compiled(function: Function) -> Function:
    """Compile ``function`` with numba on its first call; the result is cached beside its source file."""
    return _jit(function, False)


def vectorized(function: Function) -> Function:
    """The same for loops whose sums may be taken in any order, so that several terms are added at once.

    NaN and infinity keep their meaning.
    """
    return _jit(function, REORDERING_FLAGS)


def inlined(function: Function) -> Function:
    """The same for what a loop calls for every item: a call with some arrays costs as much as a hundred additions."""
    return _jit(function, False, forceinline=True)


def inlined_no_refcount(function: Function) -> Function:
    """The same as ``inlined`` for what neither makes nor returns arrays: references to those it is lent are not
    counted.

    Every row or slice of an array that is taken counts as one until it is dropped, each time by a locked write: where
    a loop takes some for every item, that is a good part of its time.
    """
    return _jit(function, False, forceinline=True, _nrt=False)


def compiled_no_refcount(function: Function) -> Function:
    """The same for what is too long to be put in place wherever it is called."""
    return _jit(function, False, _nrt=False)


def vectorized_no_refcount(function: Function) -> Function:
    """The same for loops whose sums may be taken in any order."""
    return _jit(function, REORDERING_FLAGS, forceinline=True, _nrt=False)


def _jit(function: Function, fastmath: bool | set[str], **more: bool) -> Function:
    if numba is None:
        return function
    options = {"cache": True, "nogil": True, "error_model": "numpy", **more}
    kernel: Function = numba.njit(**options, fastmath=fastmath)(function)
    return kernel


def _announce_compilation() -> None:
    """Say it once when code of this package has to be compiled: the first use takes seconds, later ones do not."""

    event = import_module("numba.core.event")

    class Announcer(event.Listener):  # type: ignore[misc, name-defined]
        said = False

        def on_start(self, happening: Any) -> None:
            dispatcher = happening.data["dispatcher"]
            if not self.said and dispatcher.py_func.__module__.startswith("extractor."):
                self.said = True
                log.warning(
                    "compiling for this machine; the first use takes about two minutes, later ones are cached"
                )

        def on_end(self, happening: Any) -> None:
            pass

    event.register("numba:compile", Announcer())


if numba is not None:
    _announce_compilation()
