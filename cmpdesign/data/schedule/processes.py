"""Worker processes: one thread each, and the same versions as the process that sends the work."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any

from cmpdesign import __version__
from cmpdesign.errors import CmpDesignError
from cmpdesign.libraries import extra, opencv_version

# Packages whose results are in a shard's bytes.
PACKAGES = ("numpy", "scipy", "pyarrow")  # and OpenCV


def limit_threads() -> None:
    """Let OpenCV and the libraries of linear algebra use one thread: processes share the cores."""
    import cv2

    with extra("data"):
        from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    threadpool_limits(1)


def work_on_one_thread(work: Callable[[Any], Any], item: Any) -> Any:
    """The result of a worker process."""
    limit_threads()
    return work(item)


@contextmanager
def one_thread() -> Iterator[None]:
    """Within this context, threads are limited as in a worker."""
    import cv2

    with extra("data"):
        from threadpoolctl import threadpool_limits

    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(before)


def installed_versions() -> dict[str, str]:
    """The versions on which the bytes of a shard depend."""
    return {"cmpdesign": __version__, "opencv": opencv_version()} | {name: version(name) for name in PACKAGES}


def require_versions(wanted: Mapping[str, str]) -> None:
    """Check that this process has the versions of the process that sends the work.

    Raises:
        CmpDesignError: a version differs.
    """
    for name, found in installed_versions().items():
        if wanted.get(name) != found:
            raise CmpDesignError(
                f"a worker has {name} {found}, this program {wanted.get(name)}; install the same versions on all "
                "machines; otherwise the data set's bytes depend on the machine"
            )
