"""The journal of a run: one line of JSON a finished trial, so that an interrupted run goes on where it stopped.

It is good for the same conditions and the same code: figures that two versions made in parts would be those of neither.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from cmpdesign.errors import CmpDesignError, OutputError

JOURNAL_NAME = "journal.jsonl"
JOURNAL_VERSION = 2
# What the results of trials are made by.
HASHED_PACKAGES = (
    "extractor",
    "cmpdesign.evaluate",
    "cmpdesign.scene",
    "cmpdesign.contact",
    "cmpdesign.patterns",
)


def fingerprint(conditions: Mapping[str, Any]) -> str:
    """SHA-256 (hex) of everything that a trial's result depends on, but for the trial itself."""
    text = json.dumps(conditions, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


@lru_cache(maxsize=1)
def code_digest() -> str:
    """SHA-256 (hex) of the Python files of ``HASHED_PACKAGES``, names and content."""
    found = hashlib.sha256()
    for package in HASHED_PACKAGES:
        spec = find_spec(package)
        for folder in (spec.submodule_search_locations or ()) if spec else ():
            for path in sorted(Path(folder).rglob("*.py")):
                text = path.read_bytes()
                found.update(f"{package}/{path.relative_to(folder).as_posix()} {len(text)}\n".encode())
                found.update(text)
    return found.hexdigest()


class Journal:
    """Results by trial, on disk.

    The first line says under which conditions and with which code; a last line that a crash cut short is dropped.

    Raises:
        CmpDesignError: the folder holds a run under other conditions or of other code, or another file under this
            name, or another process is at it.
        OutputError: it cannot be written.
    """

    def __init__(self, folder: Path, conditions: Mapping[str, Any]) -> None:
        self.path = folder / JOURNAL_NAME
        self._head = {
            "journal": JOURNAL_VERSION,
            "fingerprint": fingerprint(conditions),
            "code": code_digest(),
        }
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = self.path.open("a", encoding="utf-8", newline="\n")
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written ({error.strerror or error})") from error
        try:
            _lock_journal(self._file, self.path)
            self.results: dict[str, Any] = self._read()
            if not self.path.stat().st_size:
                self._write_line(self._head)
        except OSError as error:
            self.close()
            raise OutputError(f"{self.path}: cannot be written ({error.strerror or error})") from error
        except CmpDesignError:
            self.close()
            raise

    def add(self, key: str, result: Any) -> None:
        """Note one trial's result; it is on disk when this returns.

        Raises:
            OutputError: the disk is full or gone; what was noted before is kept.
        """
        try:
            self._write_line({"trial": key, "result": result})
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

    def _write_line(self, document: Mapping[str, Any]) -> None:
        self._file.write(json.dumps(document, separators=(",", ":"), allow_nan=False) + "\n")
        self._file.flush()

    def _read(self) -> dict[str, Any]:
        """The results so far; what follows the last whole line is cut off, so that the next one stands alone."""
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
        self._require_same_conditions(head)
        return results

    def _require_same_conditions(self, head: Any) -> None:
        """Refuse a journal that this run must not go on with."""
        if head == self._head:
            return
        remedy = "give another folder, or remove that file"
        if isinstance(head, dict) and head.get("fingerprint") == self._head["fingerprint"]:
            raise CmpDesignError(
                f"{self.path} was begun by other code than is installed now, and figures of both must not be mixed; "
                f"{remedy} to start anew"
            )
        raise CmpDesignError(
            f"{self.path} belongs to a run under other conditions (seed, sensor, design or version); {remedy}"
        )


def _lock_journal(file: TextIO, path: Path) -> None:
    """Keep other processes from this journal until it is closed, where the system can.

    Raises:
        CmpDesignError: another one has it.
    """
    try:
        import fcntl
    except ModuleNotFoundError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise CmpDesignError(
            f"{path} is in use by another run; wait until it ends, or give another folder"
        ) from error
    except OSError:  # a file system that has no locks
        return
