"""Ctrl-C is repeated until a command ends: numba's compiler catches a ``KeyboardInterrupt`` and goes on."""

from __future__ import annotations

import signal
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any

import typer

REPEAT_S = 1.0


@contextmanager
def repeated_interrupts() -> Generator[None, None, None]:
    """Within this context, SIGINT raises ``KeyboardInterrupt`` at once, and again every second until the context ends.

    Other errors after a SIGINT become ``KeyboardInterrupt``: work that caught one ends in errors of its own.
    The context changes nothing where SIGINT has another handler than Python's, or the system has no interval timers.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler or not hasattr(signal, "setitimer"):
        yield
        return
    requested = False

    def interrupt(*_: Any) -> None:
        nonlocal requested
        requested = True
        signal.setitimer(signal.ITIMER_REAL, REPEAT_S, REPEAT_S)
        raise KeyboardInterrupt

    earlier = signal.signal(signal.SIGALRM, interrupt)
    signal.signal(signal.SIGINT, interrupt)
    try:
        yield
    except typer.Exit:
        raise
    except Exception:
        if requested:
            raise KeyboardInterrupt from None
        raise
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, earlier)
        signal.signal(signal.SIGINT, signal.default_int_handler)
