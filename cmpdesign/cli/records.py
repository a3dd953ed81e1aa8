"""Records for people: fields of a document as rows and tables, with names, units and meanings of the document."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from cmpdesign.cli.terminal import say_columns, say_table

if TYPE_CHECKING:
    from cmpdesign.documents.document import DocumentPart

UNITS = {
    "px": "px",
    "mm": "mm",
    "um": "um",
    "ms": "ms",
    "n": "N",
    "deg": "degrees",
    "percent": "%",
    "mm_s": "mm/s",
    "px_mm": "px/mm",
}
SHARES = ("share", "shares")


def print_rows(done: DocumentPart, names: str, **texts: str) -> None:
    """Print fields of a document, a row for each that is known.

    Args:
        done: the document.
        names: the fields, with spaces.
        texts: field -> its text, in place of the value.
    """
    rows: dict[str, str] = {}
    for name in names.split():
        text = texts.get(name) or _text(name, getattr(done, name))
        meaning = type(done).model_fields[name].description or ""
        if text:
            words = meaning if meaning[1:2].isupper() else meaning[:1].lower() + meaning[1:]
            rows[_words(name)[0]] = f"{text} ({words.removesuffix('.')})" if words else text
    say_table(rows)


def print_parts(parts: Sequence[DocumentPart], names: str = "", *, folds: bool = False) -> None:
    """Print the parts of a document as a table, a column for each field.

    Args:
        parts: one or more.
        names: the fields, with spaces; empty: all.
        folds: see ``say_columns``.
    """
    shown = names.split() or list(type(parts[0]).model_fields)
    rows = [[_plain(getattr(part, name)) for name in shown] for part in parts]
    headings = [" ".join(filter(None, _words(name))) for name in shown]
    numbers = [all(isinstance(getattr(part, name), int | float | None) for part in parts) for name in shown]
    say_columns(
        [f">{text}" if right else text for text, right in zip(headings, numbers, strict=True)],
        rows,
        folds=folds,
    )


def print_maps(done: DocumentPart, names: str) -> None:
    """Print maps from the same names to numbers as a table, a column for each map."""
    maps = {name: getattr(done, name) for name in names.split()}
    print_table({key: {name: maps[name].get(key) for name in maps} for key in next(iter(maps.values()))})


def print_table(rows: Mapping[str, Mapping[str, float | None]]) -> None:
    """Print rows of numbers, a column for each name; empty: unknown."""
    headings = [" ".join(filter(None, _words(name))) for name in next(iter(rows.values()))]
    texts = [["" if one is None else f"{one:.6g}" for one in row.values()] for row in rows.values()]
    say_columns(
        ["", *(f">{text}" for text in headings)],
        [[name, *row] for name, row in zip(rows, texts, strict=True)],
    )


def _is_part(value: object) -> bool:
    """Whether a value is a part of a document; the function does not load the documents."""
    return hasattr(type(value), "model_fields")


def _words(name: str) -> tuple[str, str]:
    """The title of a field, and its unit; empty without one."""
    words = name.split("_")
    for count in (2, 1):
        unit = "_".join(words[-count:])
        if unit in UNITS:
            return " ".join(words[:-count]), UNITS[unit]
    return " ".join(words), ""


def _text(name: str, value: Any, unit: str = "") -> str:
    """A value with its unit; parts of the value with their names. Empty: unknown, or nothing."""
    unit = _words(name)[1] or unit
    if _is_part(value) or isinstance(value, Mapping):
        return ", ".join(_named(value, unit, name.rpartition("_")[2] in SHARES))
    if isinstance(value, list | tuple) and value and _is_part(value[0]):
        return "; ".join(_text("", each) for each in value)
    if name.startswith("size_"):
        return f"{' x '.join(map(_plain, value))} {unit}"
    text = f"{value:.2%}" if name.rpartition("_")[2] in SHARES and value is not None else _plain(value)
    return f"{text} {unit}".strip() if text else ""


def _named(part: DocumentPart | Mapping[str, Any], unit: str, is_share: bool) -> Iterator[str]:
    items = part.items() if isinstance(part, Mapping) else iter(part)
    for name, value in items:
        text = f"{value:.2%}" if is_share else _text(str(name), value, unit)
        if text:
            yield f"{_words(str(name))[0]} {text}".strip()


def _plain(value: Any) -> str:
    """A value without its unit."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {_plain(each)}" for name, each in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_plain, value))
    return "" if value is None else str(value)
