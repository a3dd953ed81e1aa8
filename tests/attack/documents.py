"""Damaged forms of a JSON document: each field left out, of another type, huge, nested, NaN, with NUL, given twice."""

from __future__ import annotations

import copy
import json
from collections.abc import Iterator
from typing import Any

# Instead of any value; as JSON texts, because Python's json writes no 1e999.
WRONG_VALUES = (
    "null", "true", "[]", "{}", "[[[[[[1]]]]]]", "-1", "1e999", "NaN", "Infinity", "1" * 5000, '"text"', '"\\u0000"',
    '"../../../etc/passwd"', '"\\ud800"', f'"{"x" * 5000}"', "[" * 60 + "]" * 60,
)  # fmt: skip
_PLACE = "\0 place \0"


def wrong_documents(document: Any) -> Iterator[str]:
    """Texts of which almost none is a document of the same schema; a free text may still be right with another text."""
    text = json.dumps(document)
    yield from (
        "",
        "{",
        "null",
        "[]",
        "3",
        '"text"',
        text[: len(text) // 2],
        text + text,
        "\0",
        '{"a":' * 100_000,
    )
    yield f'{text[:-1]}, "more": 1}}'
    for path in _paths(document):
        if isinstance(path[-1], str):
            yield json.dumps(_changed(document, path, None, leave_out=True))
            yield _with_twice(document, path)
        for value in WRONG_VALUES:
            yield json.dumps(_changed(document, path, _PLACE)).replace(json.dumps(_PLACE), value)


def _paths(value: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, each in inner:
        yield (*path, key)
        yield from _paths(each, (*path, key))


def _at(value: Any, path: tuple[str | int, ...]) -> Any:
    for key in path:
        value = value[key]
    return value


def _changed(document: Any, path: tuple[str | int, ...], value: Any, leave_out: bool = False) -> Any:
    changed = copy.deepcopy(document)
    holder = _at(changed, path[:-1])
    if leave_out:
        del holder[path[-1]]
    else:
        holder[path[-1]] = value
    return changed


def _with_twice(document: Any, path: tuple[str | int, ...]) -> str:
    """The field given twice."""
    marked = _changed(document, (*path[:-1], path[-1]), _at(document, path))
    holder = _at(marked, path[:-1])
    holder[_PLACE] = 0
    return json.dumps(marked).replace(json.dumps(_PLACE), json.dumps(path[-1]))
