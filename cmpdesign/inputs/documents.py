"""Documents of TOML and JSON, with limits on nesting and on the digits of a number."""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cmpdesign.errors import InputError
from cmpdesign.inputs.files import read_text

MAX_LEVELS = 40  # of tables and lists in each other; the deepest format has 5
MAX_BRACKETS = 1 << 19  # lists and tables of a document; a layout of 60 layers has 54,000
MAX_DIGITS = 300  # of a whole number; a float of more digits before its point is infinite


def read_toml(path: str | Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        InputError: the file cannot be read, is no TOML, or exceeds a limit; one message that begins with the path.
    """
    return parse_toml(read_text(path), str(path))


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """The document in a TOML text; ``name`` is the prefix of every error's message.

    Raises:
        InputError: no TOML, or beyond a limit.
    """
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{name} is no valid TOML: {error}") from None
    except RecursionError:
        raise InputError(f"{name}: is nested more than {MAX_LEVELS} levels deep") from None
    except ValueError:  # the interpreter's limit on the digits of an integer
        raise InputError(f"{name}: holds a number of more than {MAX_DIGITS} digits") from None
    require_plain_values(document, name)
    return document


def read_json(path: str | Path) -> Any:
    """Read a JSON file; see ``parse_json``.

    Raises:
        InputError: the file cannot be read, is no JSON, or exceeds a limit; one message that begins with the path.
    """
    return parse_json(read_text(path), str(path))


def parse_json(text: str, name: str) -> Any:
    """The value of a JSON text; names that are given twice, NaN and infinite numbers are refused.

    Raises:
        InputError: no JSON, or beyond a limit.
    """
    if text.count("[") + text.count("{") > MAX_BRACKETS:
        raise InputError(f"{name}: holds more than {MAX_BRACKETS} lists and objects")
    try:
        value = json.loads(text, object_pairs_hook=_refuse_repeated)
    except json.JSONDecodeError as error:
        raise InputError(f"{name} is no JSON: {error}") from None
    except RecursionError:
        raise InputError(f"{name}: is nested more than {MAX_LEVELS} levels deep") from None
    except _RepeatedName as error:
        raise InputError(f"{name}: the field {error} is given more than once") from None
    except ValueError:  # the interpreter's limit on the digits of an integer
        raise InputError(f"{name}: holds a number of more than {MAX_DIGITS} digits") from None
    require_plain_values(value, name, finite=True)
    return value


def require_plain_values(document: Any, name: str, *, finite: bool = False) -> None:
    """Check the nesting, the numbers and the texts of a document.

    Args:
        document: the document.
        name: the prefix of messages.
        finite: refuse NaN and infinite numbers, which TOML has and JSON has not.

    Raises:
        InputError: nested too deeply, a number that is not allowed, or a text with half a surrogate pair.
    """
    level: list[Any] = [document]
    for _ in range(MAX_LEVELS):
        inner: list[Any] = []
        for value in level:
            if isinstance(value, Mapping):
                _require_plain_texts(value, name)
                inner.extend(value.values())
            elif isinstance(value, list):
                inner.extend(value)
            elif isinstance(value, str):
                _require_plain_texts((value,), name)
            elif isinstance(value, int) and abs(value) >= 10**MAX_DIGITS:
                raise InputError(f"{name}: holds a number of more than {MAX_DIGITS} digits")
            elif finite and isinstance(value, float) and not math.isfinite(value):
                raise InputError(f"{name}: holds the number {value}; expected finite numbers")
        if not inner:
            return
        level = inner
    raise InputError(f"{name}: is nested more than {MAX_LEVELS} levels deep")


def _require_plain_texts(texts: Any, name: str) -> None:
    for text in texts:
        if not text.isascii() and any("\ud800" <= letter <= "\udfff" for letter in text):
            raise InputError(f"{name}: holds half a surrogate pair, which is no character")


class _RepeatedName(Exception):
    """A name that an object gives twice."""


def _refuse_repeated(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    for name, value in pairs:
        if name in fields:
            raise _RepeatedName(ascii(name[:40]))
        fields[name] = value
    return fields
