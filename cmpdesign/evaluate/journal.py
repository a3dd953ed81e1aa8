"""The journal of a run: one line of JSON a finished trial, so that an interrupted run goes on where it stopped."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

from cmpdesign.errors import CmpDesignError, OutputError

NAME = "journal.jsonl"


def fingerprint(conditions: Mapping[str, Any]) -> str:
    """SHA-256 (hex) of everything that a trial's result depends on, but for the trial itself."""
    text = json.dumps(conditions, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


class Journal:
    """Results by trial, on disk.

    The first line says under which conditions; a last line that a crash cut short is dropped.

    Raises:
        CmpDesignError: the folder holds a run under other conditions, or another file under this name.
        OutputError: it cannot be written.
    """

    def __init__(self, folder: Path, conditions: Mapping[str, Any]) -> None:
        self.path = folder / NAME
        self._head = {"journal": 1, "fingerprint": fingerprint(conditions)}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self.results: dict[str, Any] = self._read()
            self._file = self.path.open("a", encoding="utf-8", newline="\n")
            if self._file.tell() == 0:
                self._line(self._head)
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written ({error.strerror or error})") from error

    def add(self, key: str, result: Any) -> None:
        """Note one trial's result; it is on disk when this returns.

        Raises:
            OutputError: the disk is full or gone; what was noted before is kept.
        """
        try:
            self._line({"trial": key, "result": result})
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written ({error.strerror or error})") from error
        self.results[key] = result

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _line(self, document: Mapping[str, Any]) -> None:
        self._file.write(json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n")
        self._file.flush()

    def _read(self) -> dict[str, Any]:
        """The results so far; what follows the last whole line is cut off, so that the next one stands alone."""
        if not self.path.exists():
            return {}
        data = self.path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]
        if len(whole) < len(data):
            with self.path.open("r+b") as file:
                file.truncate(len(whole))
        if not whole:
            return {}
        try:
            head, *documents = [json.loads(line) for line in whole.decode("utf-8").splitlines()]
            results = {document["trial"]: document["result"] for document in documents}
        except (ValueError, KeyError, TypeError) as error:
            raise CmpDesignError(
                f"{self.path} is not the journal of a run ({error}); give another folder"
            ) from error
        if head != self._head:
            raise CmpDesignError(
                f"{self.path} belongs to a run under other conditions (seed, sensor, design or version); "
                "give another folder, or remove that file"
            )
        return results
