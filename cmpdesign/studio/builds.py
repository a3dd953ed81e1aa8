"""Builds as jobs: each is the command ``build`` in a process and a private folder of its own."""

from __future__ import annotations

import io
import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from threading import Thread
from typing import Any

from cmpdesign.api.designs import Design
from cmpdesign.design.commented_toml import design_toml
from cmpdesign.errors import CmpDesignError, InputError
from cmpdesign.files.atomic import write_file
from cmpdesign.inputs.documents import parse_json
from cmpdesign.inputs.files import read_file, read_text
from cmpdesign.products.registry import PREVIEW, REPORT, chosen_products
from cmpdesign.studio.designs import fields_of

MAX_RUNNING, MAX_KEPT = 2, 6
_OLDEST_TIME = (1980, 1, 1, 0, 0, 0)  # the same files give the same archive
_DESIGN, _RESULT, _MADE = "design.toml", "result.json", "made"


@dataclass(eq=False)
class Build:
    """One build.

    Attributes:
        key: name of the build for the page.
        folder: its folder, which only this user can read.
        products: the products in order.
        process: the command.
        lines: its messages: texts of steps, and of an error.
        canceled: the page ended it.
    """

    key: str
    folder: Path
    products: list[str]
    process: subprocess.Popen[str]
    lines: list[str] = field(default_factory=list)
    canceled: bool = False
    error: str = ""
    result: Any = None

    @property
    def state(self) -> str:
        """running, done, failed or canceled."""
        if self.canceled:
            return "canceled"
        if self.process.poll() is None or (self.result is None and not self.error):
            return "running"
        return "failed" if self.error else "done"

    def files(self) -> dict[str, Path]:
        """Name -> file, of a build that is done; the design is the first."""
        if self.state != "done":
            return {}
        made = self.folder / _MADE
        found = sorted(path for path in made.rglob("*") if path.is_file() and not path.name.startswith("."))
        return {_DESIGN: self.folder / _DESIGN, **{path.relative_to(made).as_posix(): path for path in found}}

    def document(self) -> dict[str, Any]:
        """The state for the page."""
        steps = [name for name in self.products if name not in (PREVIEW, REPORT)]
        begun = sum(" begins (" in line for line in self.lines)
        return {
            "key": self.key,
            "state": self.state,
            "log": self.lines[-200:],
            "progress": 1.0 if self.state == "done" else max(0, begun - 1) / (len(steps) + 1),
            "error": self.error,
            "files": [{"name": name, "bytes": path.stat().st_size} for name, path in self.files().items()],
            "result": self.result,
        }

    def archive(self) -> bytes:
        """All files as ZIP."""
        data = io.BytesIO()
        with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, path in self.files().items():
                archive.writestr(zipfile.ZipInfo(name, _OLDEST_TIME), read_file(path), zipfile.ZIP_DEFLATED)
        return data.getvalue()

    def cancel(self) -> None:
        """End the process and all that it started, and remove the folder."""
        self.canceled = self.canceled or self.state == "running"
        if self.process.poll() is None:
            if sys.platform == "win32":
                self.process.kill()
            else:
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)

    def follow(self) -> None:
        """Take the messages of the process until its end; runs in a thread."""
        assert self.process.stderr is not None
        with self.process.stderr as lines:
            for line in lines:
                message = _document(line)
                text = str(message.get("text", line)) if isinstance(message, dict) else line
                is_error = isinstance(message, dict) and message.get("level") == "error"
                self.error = text if is_error else self.error
                self.lines.append(text.strip())
        ended = self.process.wait()
        if self.canceled:
            return
        result = _document(read_text(self.folder / _RESULT))
        if ended not in (0, 1):  # 1: a finding is an error; the files are there
            self.error = self.error or f"the build ended with exit code {self.process.returncode}"
        elif result is None:
            self.error = self.error or "the build printed no document"
        self.result = result


class Builds:
    """The builds of this run of the page; the oldest are removed."""

    def __init__(self) -> None:
        self._builds: dict[str, Build] = {}

    def start(self, design: Design, products: Iterable[str], camera_px: tuple[int, int]) -> Build:
        """Start a build.

        Raises:
            CmpDesignError: an unknown product, or too many builds run.
        """
        names = chosen_products(",".join(products))
        if sum(build.state == "running" for build in self._builds.values()) >= MAX_RUNNING:
            raise CmpDesignError(f"{MAX_RUNNING} builds run already, the limit; wait for one, or cancel it")
        folder = Path(tempfile.mkdtemp(prefix="cmpdesign-studio-"))
        write_file(folder / _DESIGN, design_toml(fields_of(design)))
        words = [
            _DESIGN,
            "-o",
            _MADE,
            "--only",
            ",".join(names),
            "--camera",
            f"{camera_px[0]}x{camera_px[1]}",
        ]
        with (folder / _RESULT).open("wb") as result:
            process = subprocess.Popen(
                [sys.executable, "-m", "cmpdesign", "build", *words, "--json", "--verbose"],
                cwd=folder,
                stdin=subprocess.DEVNULL,
                stdout=result,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                start_new_session=True,
            )
        build = Build(secrets.token_hex(8), folder, names, process)
        Thread(target=build.follow, daemon=True).start()
        self._builds[build.key] = build
        for old in [one for one in self._builds.values() if one.state != "running"][:-MAX_KEPT]:
            self._builds.pop(old.key).cancel()
        return build

    def get(self, key: str) -> Build:
        """A build by its key.

        Raises:
            CmpDesignError: no such build.
        """
        if key not in self._builds:
            raise CmpDesignError("this build is gone; build again")
        return self._builds[key]

    def close(self) -> None:
        """End and remove all builds."""
        for build in self._builds.values():
            build.cancel()


def _document(text: str) -> Any:
    try:
        return parse_json(text, "the build's output")
    except InputError:
        return None
