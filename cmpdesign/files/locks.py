"""Locks of files and folders between processes; the system releases a lock when its process ends."""

from __future__ import annotations

import os
import sys
from enum import Enum
from pathlib import Path


class Lock(Enum):
    """The outcome of an attempt to lock."""

    HELD = "held"  # by this process, until the descriptor is closed
    TAKEN = "taken"  # by another process
    UNSUPPORTED = "unsupported"  # by the system or the file system


# Windows locks bytes, and no other process can read a locked byte: this byte lies behind the end of every locked file.
_LOCKED_BYTE = 2**31 - 2


def try_lock(descriptor: int) -> Lock:
    """Try to lock an open file or folder against other processes, without waiting.

    On Windows folders cannot be opened, and are not locked.
    """
    try:
        _lock(descriptor)
    except (BlockingIOError, PermissionError):
        return Lock.TAKEN
    except OSError:
        return Lock.UNSUPPORTED
    return Lock.HELD


if sys.platform == "win32":

    def _lock(descriptor: int) -> None:
        import msvcrt

        place = os.lseek(descriptor, 0, os.SEEK_CUR)
        try:
            os.lseek(descriptor, _LOCKED_BYTE, os.SEEK_SET)
            msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
        finally:
            os.lseek(descriptor, place, os.SEEK_SET)

else:

    def _lock(descriptor: int) -> None:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)


def open_for_lock(path: Path) -> int | None:
    """A descriptor of a file or folder for ``try_lock``, not through a link; None where the system gives no
    descriptor.
    """
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    try:
        return os.open(path, flags)
    except OSError:
        return None


def is_in_use(path: Path) -> bool:
    """True if another process, or another descriptor of this process, holds a lock of the file or folder."""
    descriptor = open_for_lock(path)
    if descriptor is None:
        return False
    try:
        return try_lock(descriptor) is Lock.TAKEN
    finally:
        os.close(descriptor)
