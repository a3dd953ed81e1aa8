"""A running page, and an installed Chromium that Playwright drives; tests and pictures of the page use them, too."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

# As root, Chromium runs without its sandbox only; SwiftShader draws 3-D without a graphics card.
FLAGS = ("--no-sandbox", "--enable-unsafe-swiftshader", "--use-fake-ui-for-media-stream")


def chromium() -> str | None:
    """The path of an installed Chromium; None without one."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


@contextmanager
def served(*words: str) -> Iterator[str]:
    """The address of a running page: of ``cmpdesign studio``, or of the words of another command."""
    command = [sys.executable, "-m", "cmpdesign", *(words or ("studio",)), "--port", "0", "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    with process.stdout as printed:
        try:
            yield printed.readline().strip()
        finally:
            process.terminate()
            process.wait(20)


def options(camera: Path | None = None) -> dict[str, Any]:
    """How Playwright starts it; ``camera``: the .mjpeg or .y4m file that it takes for its camera."""
    flags = [*FLAGS]
    if camera is not None:
        flags += ["--use-fake-device-for-media-stream", f"--use-file-for-fake-video-capture={camera}"]
    return {"executable_path": chromium(), "args": flags}


@contextmanager
def browser(camera: Path | None = None) -> Iterator[Any]:
    """Chromium, driven by Playwright; for ``camera`` see ``options``."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        running = playwright.chromium.launch(**options(camera))
        yield running
        running.close()
