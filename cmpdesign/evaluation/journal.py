"""The journal of a run: one line of JSON per finished trial, so that an interrupted run can be continued.

A journal is valid for the same conditions and the same code, because results of different code must not be mixed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from cmpdesign.errors import CmpDesignError, InputError, OutputError
from cmpdesign.files.locks import Lock, try_lock
from cmpdesign.inputs.documents import parse_json
from cmpdesign.inputs.files import is_regular_file, path_exists, read_file
from cmpdesign.inputs.records import Digest, Record, checked_record

JOURNAL_NAME = "journal.jsonl"
JOURNAL_VERSION = 3
# Packages and modules that the results of trials depend on; of the compiled loops, the files that are loaded.
HASHED_PACKAGES = (
    "extractor",
    "extractor._native",
    "cmpdesign._native",
    "cmpdesign.evaluation",
    "cmpdesign.scene",
    "cmpdesign.contact",
    "cmpdesign.patterns",
    "cmpdesign.design",
    "cmpdesign.layout",
    "cmpdesign.files",
    "cmpdesign.units",
)


def fingerprint(conditions: Mapping[str, Any]) -> str:
    """SHA-256 (hex) of the conditions of a run, which determine all results."""
    text = json.dumps(conditions, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


@lru_cache(maxsize=1)
def code_digest() -> str:
    """SHA-256 (hex) of the files of ``HASHED_PACKAGES`` that run, names and content."""
    digest = hashlib.sha256()
    for package in HASHED_PACKAGES:
        for name, path in _source_files(package):
            text = path.read_bytes()
            digest.update(f"{package}/{name} {len(text)}\n".encode())
            digest.update(text)
    return digest.hexdigest()


def _source_files(package: str) -> Iterator[tuple[str, Path]]:
    """Names and paths of the Python files of a package, or of a single module of any kind; none if not installed."""
    spec = find_spec(package)
    if spec is None:
        return
    if spec.submodule_search_locations is None:
        yield "", Path(spec.origin or "")
    for folder in spec.submodule_search_locations or ():
        for path in sorted(Path(folder).rglob("*.py")):
            yield path.relative_to(folder).as_posix(), path


class _Line(Record):
    """The result of one trial."""

    trial: str
    result: Any
    digest: Digest


def _digest_of(key: str, result: Any) -> str:
    return fingerprint({"trial": key, "result": result})


class Journal:
    """Results by trial, on disk.

    The first line holds the digests of conditions and code; every other line holds its own digest, so that an edited
    result is no result. An incomplete last line, left by a crash, is removed.

    Attributes:
        path: the journal's file.
        results: the results by the trials' keys.

    Raises:
        CmpDesignError: the folder holds a run under other conditions or of other code, or another file of this
            name, or another process uses the journal.
        OutputError: the file cannot be written.
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
            if path_exists(self.path) and not is_regular_file(self.path):
                raise OutputError(f"{self.path} is no regular file; remove it, or give another folder")
            self._file = self.path.open("a", encoding="utf-8", newline="\n")
        except (OSError, ValueError) as error:
            if isinstance(error, OutputError):
                raise
            reason = getattr(error, "strerror", None) or error
            raise OutputError(f"{self.path}: cannot be written ({reason})") from error
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
        """Append one trial's result and write it to disk.

        Raises:
            OutputError: the file cannot be written; earlier results are kept.
        """
        try:
            self._write_line({"trial": key, "result": result, "digest": _digest_of(key, result)})
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written ({error.strerror or error})") from error
        self.results[key] = result

    def close(self) -> None:
        """Close the file and release its lock."""
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
        """The results on disk. The file is truncated after its last complete line."""
        data = read_file(self.path)
        complete = data[: data.rfind(b"\n") + 1]
        if len(complete) < len(data):
            with self.path.open("r+b") as file:
                file.truncate(len(complete))
        if not complete:
            return {}
        try:
            lines = complete.decode("utf-8").split("\n")[:-1]
            head, *documents = [
                parse_json(line, f"line {number}") for number, line in enumerate(lines, start=1)
            ]
            lines_read = [
                checked_record(each, f"line {n}", _Line) for n, each in enumerate(documents, start=2)
            ]
        except (InputError, ValueError) as error:
            raise CmpDesignError(
                f"{self.path} is not the journal of a run ({error}); give another folder"
            ) from error
        self._require_same_conditions(head)
        for number, line in enumerate(lines_read, start=2):
            if line.digest != _digest_of(line.trial, line.result):
                raise CmpDesignError(
                    f"{self.path}: line {number} was changed after it was written; remove the file to start anew"
                )
        return {line.trial: line.result for line in lines_read}

    def _require_same_conditions(self, head: Any) -> None:
        """Raise ``CmpDesignError`` for a journal of other conditions or of other code."""
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
    """Lock the journal against other processes until it is closed, where the system supports locks.

    Raises:
        CmpDesignError: another process has locked it.
    """
    if try_lock(file.fileno()) is Lock.TAKEN:
        raise CmpDesignError(f"{path} is in use by another run; wait until it ends, or give another folder")
