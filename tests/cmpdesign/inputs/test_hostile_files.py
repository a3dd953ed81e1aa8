"""A file with any content is read, or refused within a second by an error of the project."""

from __future__ import annotations

import json
import os
import signal
import socket
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.texts import MAX_LINE_LETTERS, one_line
from extractor import ExtractorError
from tests.support.hostile.input_files import DATA, DOCUMENTS, EVERY, LEFT, InputFile, as_text, toml

EXPECTED = (CmpDesignError, ExtractorError)
LIMIT_S = 10
# Names that reach XML, job sheets, file names or the terminal: they are refused where they are read.
NAMES = {
    "design": ("name", "description", "source"),
    "machine": ("name", "power_w.source"),
    "material": ("name", "fill", "cure", "fumes", "thickness_mm.source"),
    "silicone": ("name", "remedy", "shrinkage_percent.source"),
    "sensor": ("name", "description", "source"),
    "rig": ("view.0.name",),
    "layout": ("pattern", "generator"),
    "coupon": ("machine", "material", "patches.0.name"),
}


@contextmanager
def at_once() -> Iterator[None]:
    """Fail, rather than wait, when a reader hangs."""

    def fail(number: int, frame: Any) -> None:
        raise TimeoutError(f"longer than {LIMIT_S} s")

    before = signal.signal(signal.SIGALRM, fail)
    signal.alarm(LIMIT_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def answer(kind: InputFile, path: Path) -> str | None:
    """The message that refuses the file; None if the file is read."""
    try:
        with at_once():
            kind.read(path)
    except EXPECTED as error:
        line = one_line(error)
        assert line.isprintable() and 0 < len(line) <= MAX_LINE_LETTERS
        return line
    return None


def refused(kind: InputFile, path: Path) -> str:
    line = answer(kind, path)
    assert line is not None
    return line


@pytest.mark.parametrize("name", EVERY)
def test_a_good_file_is_read(name: str, tmp_path: Path) -> None:
    kind = EVERY[name]
    kind.good(tmp_path / kind.name)
    assert answer(kind, tmp_path / kind.name) is None


# -- what is no regular file


def a_pipe(path: Path) -> None:
    os.mkfifo(path)


def a_folder(path: Path) -> None:
    path.mkdir()


def a_loop(path: Path) -> None:
    path.symlink_to(path)


def a_device(path: Path) -> None:
    path.symlink_to("/dev/zero")


def a_socket(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as end:
        os.chdir(path.parent)  # the name of a socket has at most 107 bytes
        end.bind(path.name)


def nothing(path: Path) -> None:
    path.touch()


def garbage(path: Path) -> None:
    path.write_bytes(bytes(range(256)) * 20)


@pytest.mark.parametrize("make", [a_pipe, a_folder, a_loop, a_device, a_socket, nothing, garbage])
@pytest.mark.parametrize("name", EVERY)
def test_what_is_no_such_file_is_one_line(
    name: str, make: Callable[[Path], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    kind = EVERY[name]
    make(tmp_path / kind.name)
    line = answer(kind, tmp_path / kind.name)
    # A list of files and a resolution are a help that may be missing; an empty journal and an empty scene are new ones.
    is_new = make is nothing and name in ("journal", "scene")
    assert line is not None or is_new or name in ("list of files", "resolution")


@pytest.mark.parametrize("name", [*DOCUMENTS, *DATA])
@pytest.mark.parametrize("path", ["x" * 300, "a\0b", "a\udcffb", "a\x1b[31mb", "d/" * 3000 + "x", ""])
def test_a_path_that_cannot_be_is_one_line(name: str, path: str, tmp_path: Path) -> None:
    if name == "resolution":
        assert answer(DATA[name], tmp_path / path) is None
    else:
        refused(EVERY[name], tmp_path / path)


# -- what is no such document


def loaded(kind: InputFile, folder: Path) -> Any:
    text = kind.document(folder)
    return tomllib.loads(text) if kind.name.endswith(".toml") else json.loads(text)


def tables(value: Any, here: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], dict[str, Any]]]:
    if isinstance(value, dict):
        yield here, value
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in list(items)[:40]:
        yield from tables(item, (*here, str(key)))


@pytest.mark.parametrize("name", DOCUMENTS)
def test_an_unknown_name_is_refused_with_the_nearest_known_one(name: str, tmp_path: Path) -> None:
    kind = DOCUMENTS[name]
    document = loaded(kind, tmp_path)
    path = tmp_path / kind.name
    tried = 0
    for place, table in tables(document):
        if ".".join(place) in kind.free:
            continue
        for key in list(table)[:3]:
            table[key + "q"] = table[key]
            path.write_text(as_text(document, kind), encoding="utf-8")
            line = refused(kind, path)
            assert key + "q" in line and f"did you mean {key}?" in line, line
            del table[key + "q"]
            tried += 1
    assert tried >= 3


KEYS = (
    "a[b",
    "tuple[a]",
    "float",
    "str",
    "self",
    "a.b",
    "",
    "0",
    "x" * 300,
    "a\x1b[31m",
    "a\nb",
    "__class__",
    "é",
)


@pytest.mark.parametrize("name", DOCUMENTS)
def test_odd_names_of_fields_are_refused(name: str, tmp_path: Path) -> None:
    kind = DOCUMENTS[name]
    document = loaded(kind, tmp_path)
    path = tmp_path / kind.name
    for place, table in tables(document):
        if ".".join(place) in kind.free:
            continue
        for key in KEYS:
            table[key] = 1
            path.write_text(as_text(document, kind), encoding="utf-8")
            refused(kind, path)
            del table[key]


def leaves(value: Any, holder: Any = None, key: Any = None) -> Iterator[tuple[Any, Any, Any]]:
    """Values without parts, with their containers; of a list, the first two entries."""
    if isinstance(value, dict):
        for inner, item in value.items():
            yield from leaves(item, value, inner)
    elif isinstance(value, list) and value:
        for place, item in enumerate(value[:2]):
            yield from leaves(item, value, place)
    else:
        yield holder, key, value


VALUES: dict[str, Any] = {
    "400 digits": 10**400,
    "4,000 digits": 10**4000,
    "a long text": "x" * 300,
    "a longer text": "x" * 100_000,
    "an escape": "a\x1b[31mb",
    "a line break": "a\nb",
    "NUL": "a\0b",
    "C1": "a\x9bb",
    "a reversal": "a\u202eb",
    "a table": {"a": {"b": 1}},
    "a list": [1, "two", [3]],
    "an empty text": "",
    "no number": float("nan"),
    "infinite": float("-inf"),
    "true": True,
    "minus one": -1,
}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_any_value_anywhere_is_read_or_refused(name: str, tmp_path: Path) -> None:
    kind = DOCUMENTS[name]
    document = loaded(kind, tmp_path)
    path = tmp_path / kind.name
    for holder, key, before in leaves(document):
        for value in VALUES.values():
            holder[key] = value
            path.write_text(as_text(document, kind), encoding="utf-8")
            answer(kind, path)
        holder[key] = before


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("letters", ["\x1b]0;title\x07", "\n", "\0", "\x9b31m", "\u202e", "\ud800"])
def test_names_hold_no_control_characters(name: str, letters: str, tmp_path: Path) -> None:
    kind = DOCUMENTS[name]
    for place in NAMES[name]:
        document = loaded(kind, tmp_path)
        holder: Any = document
        *parents, last = place.split(".")
        for part in parents:
            holder = holder[int(part)] if isinstance(holder, list) else holder[part]
        holder[last] = f"a{letters}b"
        path = tmp_path / kind.name
        path.write_text(as_text(document, kind), encoding="utf-8")
        refused(kind, path)


ODD = {
    "deep lists": "[" * 3000 + "]" * 3000,
    "deep tables": '{"a": ' * 3000 + "1" + "}" * 3000,
    "41 lists": "[" * 41 + "]" * 41,
    "many digits": "9" * 100_000,
    "unclosed": "[" * 3000,
    "half a pair": '"\\ud800"',
}


@pytest.mark.parametrize("odd", ODD)
@pytest.mark.parametrize("name", [*DOCUMENTS, *LEFT])
def test_odd_documents_are_one_line(name: str, odd: str, tmp_path: Path) -> None:
    """As the value of a field, and as the whole document."""
    kind = EVERY[name]
    value = ODD[odd].replace('": ', '" = ') if kind.name.endswith(".toml") else ODD[odd]
    field = f"pattern = {value}" if kind.name.endswith(".toml") else f'{{"format": {value}}}'
    for content in (value, field):
        (tmp_path / kind.name).write_text(content + "\n", encoding="utf-8")
        line = answer(kind, tmp_path / kind.name)
        assert line is not None or name == "list of files"
        (tmp_path / kind.name).unlink()


@pytest.mark.parametrize("name", [name for name, kind in DOCUMENTS.items() if kind.name.endswith(".json")])
def test_many_names_take_no_time(name: str, tmp_path: Path) -> None:
    """60,000 names, the last one twice; then all of them different and unknown."""
    kind = DOCUMENTS[name]
    pairs = [f'"k{number}": 1' for number in range(60_000)]
    for text in (f"{{{', '.join([*pairs, pairs[-1]])}}}", f"{{{', '.join(pairs)}}}"):
        (tmp_path / kind.name).write_text(text, encoding="utf-8")
        refused(kind, tmp_path / kind.name)


@pytest.mark.parametrize("name", [name for name, kind in DOCUMENTS.items() if kind.name.endswith(".toml")])
def test_many_unknown_names_take_no_time(name: str, tmp_path: Path) -> None:
    kind = DOCUMENTS[name]
    text = "".join(f"k{number} = 1\n" for number in range(5_000))
    (tmp_path / kind.name).write_text(text + kind.document(tmp_path), encoding="utf-8")
    refused(kind, tmp_path / kind.name)


def test_the_writers_of_tests_are_read() -> None:
    value = {"a b": [1, 2.5, 'x"y'], "c": {"d": True}}
    assert tomllib.loads(f"x = {toml(value)}")["x"] == value
