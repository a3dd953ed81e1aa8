"""What a process does before it makes shards, and what it must have in common with the process that sends them."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Mapping
from importlib.metadata import version

from cmpdesign import __version__
from cmpdesign.errors import CmpDesignError

# Packages whose results are in a shard's bytes.
PACKAGES = ("numpy", "scipy", "opencv-contrib-python-headless", "pyarrow")


def start_local_worker() -> None:
    """Make this process a worker of its parent: one thread, no Ctrl-C of its own, and an end with the parent's.

    Ctrl-C reaches all processes of a terminal; the parent ends the run.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    limit_threads()


def _end_with_parent() -> None:
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)  # whatever the main thread does; files that are not complete have no name


def limit_threads() -> None:
    """Let OpenCV and the libraries of linear algebra use one thread: processes share the cores."""
    import cv2
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    threadpool_limits(1)


def installed_versions() -> dict[str, str]:
    """The versions on which the bytes of a shard depend."""
    return {"cmpdesign": __version__} | {name: version(name) for name in PACKAGES}


def require_versions(wanted: Mapping[str, str]) -> None:
    """Check that this process has the versions of the process that sends the work.

    Raises:
        CmpDesignError: a version differs.
    """
    for name, found in installed_versions().items():
        if wanted.get(name) != found:
            raise CmpDesignError(
                f"a worker has {name} {found}, this program {wanted.get(name)}; install the same versions on all "
                "machines, or the data set's bytes depend on the machine"
            )
