"""Typed fields of a JSON document: each function returns a checked value or raises ``LayoutError``."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from extractor.errors import LayoutError

MAX_MM = 1e6  # one kilometre: larger than any sensor; squares of lengths still have enough digits
MAX_INT = 2**31 - 1
# Of a document; a layout of 200 layers has 0.6 million lists and 2.7 million commas.
MAX_BRACKETS, MAX_COMMAS = 1 << 20, 1 << 22
MAX_LEVELS = 40  # of lists and objects in each other
MAX_DIGITS = 300  # of a whole number; a float of more digits before its point is infinite


def fail(field: str, value: str, expected: str) -> NoReturn:
    """Raise a ``LayoutError`` that names a field, its value and what is expected."""
    raise LayoutError(f"{field} is {value}; expected {expected}")


def shown(value: object) -> str:
    """A JSON value on one short printable line."""
    match value:
        case dict():
            return f"an object of {len(value)} fields"
        case list():
            return f"a list of {len(value)}"
        case bool() | None:
            return json.dumps(value)
        case str():
            return ascii(value if len(value) <= 40 else value[:37] + "...")
        case int():
            return str(value) if abs(value) <= 10**30 else f"an integer of {value.bit_length()} bits"
    return repr(value)


def document(text: str) -> dict[str, Any]:
    """The JSON object in ``text``.

    Raises:
        LayoutError: not JSON, not an object, or with NaN, Infinity or a repeated name.
    """
    if text.count("[") + text.count("{") > MAX_BRACKETS or text.count(",") > MAX_COMMAS:
        raise LayoutError(
            f"holds more than {MAX_BRACKETS} lists or {MAX_COMMAS} values; expected a layout file"
        )
    try:
        value = json.loads(text, parse_constant=_refuse_constant, object_pairs_hook=_refuse_duplicates)
    except json.JSONDecodeError as error:
        raise LayoutError(
            f"not JSON, or truncated: {error.msg} at line {error.lineno}, column {error.colno}"
        ) from None
    except RecursionError:
        raise LayoutError("nested too deeply; expected lists and objects at most a few levels deep") from None
    except LayoutError:
        raise
    except ValueError:  # the interpreter's limit on an integer's digits
        raise LayoutError("holds an integer of thousands of digits; expected at most 10 digits") from None
    if not isinstance(value, dict):
        fail("the document", shown(value), "an object")
    return value


def _refuse_constant(name: str) -> NoReturn:
    raise LayoutError(f"holds the value {name}; expected finite numbers only")


def _refuse_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for name, value in pairs:
        if name in fields:
            raise LayoutError(f"the field {shown(name)} is given more than once; expected once")
        fields[name] = value
    return fields


def known_fields(
    container: dict[str, Any], names: Sequence[str], prefix: str = "", optional: Sequence[str] = ()
) -> None:
    """Check that an object has all fields of these names and, except for the optional fields, no other field."""
    for name in names:
        if name not in container:
            fail(prefix + name, "missing", f"one of the fields {', '.join(names)}")
    for name in container:
        if name not in names and name not in optional:
            fail(
                prefix + shown(name),
                f"unknown{nearest_name(name, (*names, *optional))}",
                _known(names, optional),
            )


def _known(names: Sequence[str], optional: Sequence[str]) -> str:
    return f"only the fields {', '.join((*names, *optional))}"


def require_version_2(container: dict[str, Any], names: Sequence[str], prefix: str, version: int) -> None:
    """Check that a file of version 1 has none of these fields, which version 2 adds."""
    for name in names:
        if version < 2 and name in container:
            fail(
                prefix + name,
                f"given in a file of version {version}",
                "version 2, or a file without the field",
            )


def nearest_name(word: str, known: Sequence[str]) -> str:
    """The part of a message that states the nearest known name; empty if no known name is near."""
    import difflib

    found = difflib.get_close_matches(word[:60], known, n=1, cutoff=0.6)
    return f" (did you mean {found[0]}?)" if found else ""


def require_plain_values(value: object, field: str) -> None:
    """Check a value of free form: its levels, the digits of its numbers, the characters of its texts."""
    level = [value]
    for _ in range(MAX_LEVELS):
        inner: list[object] = []
        for item in level:
            texts: Iterable[object] = item if isinstance(item, dict) else (item,)
            if any(isinstance(text, str) and not _is_encodable(text) for text in texts):
                fail(field, "a text with half a surrogate pair", "characters of Unicode")
            if type(item) is int and abs(item) >= 10**MAX_DIGITS:
                fail(field, shown(item), f"numbers of at most {MAX_DIGITS} digits")
            inner.extend(item.values() if isinstance(item, dict) else item if isinstance(item, list) else ())
        if not inner:
            return
        level = inner
    fail(field, "nested too deeply", f"at most {MAX_LEVELS} levels")


def _is_encodable(text: str) -> bool:
    return text.isascii() or not any("\ud800" <= letter <= "\udfff" for letter in text)


def mapping(value: object, field: str) -> dict[str, Any]:
    """An object."""
    if not isinstance(value, dict):
        fail(field, shown(value), "an object")
    return value


def text_field(value: object, field: str) -> str:
    """A printable text that is not empty."""
    if not isinstance(value, str) or not value.isprintable() or not value:
        fail(field, shown(value), "a printable text")
    return value


def integer(value: object, field: str, low: int, high: int) -> int:
    """An integer from ``low`` to ``high``."""
    if type(value) is not int or not low <= value <= high:
        fail(field, shown(value), f"an integer from {low} to {high}")
    return value


def length_mm(value: object, field: str) -> float:
    """A finite length in mm, zero or more."""
    if type(value) not in (int, float) or not 0 <= value <= MAX_MM:  # type: ignore[operator]
        fail(field, shown(value), f"a length from 0 to {MAX_MM:g} mm")
    return float(value)  # type: ignore[arg-type]


def integers(value: object, field: str, high: int, length: int | None = None) -> NDArray[np.int32]:
    """(N,) int32 from 0 to ``high``."""
    column = _list_value(value, field, length)
    return _integers(column, field, high, 1)


def integer_rows(value: object, field: str, high: int, widths: tuple[int, ...]) -> NDArray[np.int32]:
    """(N, W) int32 from 0 to ``high``; all rows have one width W, which is one of ``widths``."""
    flat, width = _flat_rows(value, field, widths)
    return _integers(flat, field, high, width).reshape(-1, width)


def lengths_mm(value: object, field: str, length: int, *, nullable: bool = False) -> NDArray[np.float64]:
    """(N,) finite float64 in mm, of either sign; where this is allowed, NaN for null."""
    column = _list_value(value, field, length)
    if not nullable:
        return _lengths_mm(column, field, 1)
    lengths = _lengths_mm([0.0 if item is None else item for item in column], field, 1)
    lengths[[item is None for item in column]] = np.nan
    return lengths


def points_mm(value: object, field: str) -> NDArray[np.float64]:
    """(N, 2) finite float64 in mm."""
    flat, width = _flat_rows(value, field, (2,))
    return _lengths_mm(flat, field, width).reshape(-1, 2)


def choices(value: object, field: str, length: int, names: Sequence[str]) -> NDArray[np.uint8]:
    """(N,) uint8, the index of each text in ``names``."""
    column = _list_value(value, field, length)
    codes = {name: code for code, name in enumerate(names)}
    indices = [codes.get(item, -1) if type(item) is str else -1 for item in column]
    if -1 in indices:
        first = indices.index(-1)
        fail(f"{field}[{first}]", shown(column[first]), f"one of {', '.join(names)}")
    return np.array(indices, dtype=np.uint8)


def _list_value(value: object, field: str, length: int | None) -> list[Any]:
    if not isinstance(value, list):
        fail(field, shown(value), "a list")
    if not value:
        fail(field, "empty", "at least one entry")
    if length is not None and len(value) != length:
        fail(field, f"a list of {len(value)}", f"{length} entries, one for each of its companions")
    return value


def _flat_rows(value: object, field: str, widths: tuple[int, ...]) -> tuple[list[Any], int]:
    rows = _list_value(value, field, None)
    first_width = len(rows[0]) if type(rows[0]) is list else -1
    width = first_width if first_width in widths else widths[0]
    if set(map(type, rows)) != {list} or set(map(len, rows)) != {width}:
        wrong = next(i for i, row in enumerate(rows) if type(row) is not list or len(row) != width)
        fail(f"{field}[{wrong}]", shown(rows[wrong]), f"a list of {width}")
    return list(chain.from_iterable(rows)), width


def _integers(flat: list[Any], field: str, high: int, width: int) -> NDArray[np.int32]:
    if set(map(type, flat)) != {int} or min(flat) < 0 or max(flat) > high:
        wrong = next(i for i, item in enumerate(flat) if type(item) is not int or not 0 <= item <= high)
        fail(_field_path(field, wrong, width), shown(flat[wrong]), f"an integer from 0 to {high}")
    return np.array(flat, dtype=np.int32)


def _lengths_mm(flat: list[Any], field: str, width: int) -> NDArray[np.float64]:
    if not set(map(type, flat)) <= {int, float} or not all(-MAX_MM <= item <= MAX_MM for item in flat):
        wrong = next(i for i, item in enumerate(flat) if not _is_length(item))
        fail(
            _field_path(field, wrong, width),
            shown(flat[wrong]),
            f"a number from {-MAX_MM:g} to {MAX_MM:g} mm",
        )
    return np.array(flat, dtype=np.float64)


def _is_length(item: object) -> bool:
    return type(item) in (int, float) and -MAX_MM <= item <= MAX_MM  # type: ignore[operator]


def _field_path(field: str, index: int, width: int) -> str:
    """The name of one entry of a flattened list of rows."""
    return f"{field}[{index}]" if width == 1 else f"{field}[{index // width}][{index % width}]"
