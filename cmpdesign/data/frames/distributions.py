"""Distributions in a plan: instead of a value of a scene file, a plan may have a table that states how to draw the
value.

A table with one of these names is a distribution:

* ``{uniform = [low, high]}``, ``{log_uniform = [low, high]}``: a number between the two;
* ``{normal = [mean, deviation]}``: a number within three deviations of the mean;
* ``{whole = [low, high]}``: a whole number, both ends included;
* ``{choice = [a, b, ...], weights = [1, 2, ...]}``: one of the values, which may be tables; ``weights`` may be absent;
* ``{repeat = 3, of = ...}``: a list of this number of values, each drawn anew; the number may be a distribution, too;
* ``{chance = 0.2, of = ...}``: the value with this chance, otherwise no key.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.validation import shown_value

# The name of a distribution -> the other keys that its table may have.
KINDS: Mapping[str, frozenset[str]] = {
    "uniform": frozenset(),
    "log_uniform": frozenset(),
    "normal": frozenset(),
    "whole": frozenset(),
    "choice": frozenset({"weights"}),
    "repeat": frozenset({"of"}),
    "chance": frozenset({"of"}),
}
MAX_REPEATS = 1000
MAX_VALUES = 10_000  # of one draw; a scene of 100 blobs, scratches and lamps each has some 2,000
MAX_DEVIATIONS = 3.0
Scalar = str | float | int | bool


class Source(Protocol):
    """The methods of ``numpy.random.Generator`` that are used."""

    def random(self) -> float: ...

    def standard_normal(self) -> float: ...


class _Absent:
    """The value of a key that is left out."""


ABSENT = _Absent()


def distribution_kind(value: object) -> str | None:
    """The name of the distribution that a value is; None for a plain value."""
    if not isinstance(value, Mapping):
        return None
    return next((kind for kind in KINDS if kind in value), None)


def draw(value: Any, rng: Source) -> Any:
    """A value with all distributions drawn, in the order of the document; ``ABSENT`` where a chance failed.

    Args:
        value: a plain value, a list, a table or a distribution, checked by ``check_distributions``.
        rng: the source of all random numbers.
    """
    kind = distribution_kind(value)
    if kind is not None:
        return _draw_kind(kind, value, rng)
    if isinstance(value, Mapping):
        drawn = {key: draw(inner, rng) for key, inner in value.items()}
        return {key: inner for key, inner in drawn.items() if inner is not ABSENT}
    if isinstance(value, list | tuple):
        return [inner for inner in (draw(each, rng) for each in value) if inner is not ABSENT]
    return value


def _draw_kind(kind: str, table: Mapping[str, Any], rng: Source) -> Any:
    given = table[kind]
    match kind:
        case "uniform":
            return given[0] + (given[1] - given[0]) * rng.random()
        case "log_uniform":
            return given[0] * (given[1] / given[0]) ** rng.random()
        case "normal":
            return given[0] + given[1] * _standard_normal(rng)
        case "whole":
            return given[0] + int((given[1] - given[0] + 1) * rng.random())
        case "choice":
            return draw(given[_chosen(len(given), table.get("weights"), rng)], rng)
        case "repeat":
            return [draw(table["of"], rng) for _ in range(int(draw(given, rng)))]
    is_there = rng.random() < given
    return draw(table["of"], rng) if is_there else ABSENT


def _standard_normal(rng: Source) -> float:
    while True:
        value = float(rng.standard_normal())
        if abs(value) <= MAX_DEVIATIONS:
            return value


def _chosen(count: int, weights: Sequence[float] | None, rng: Source) -> int:
    """The place of one of ``count`` values."""
    weights = [1.0] * count if weights is None else weights
    rest = sum(weights) * rng.random()
    for place, weight in enumerate(weights):
        rest -= weight
        if rest < 0:
            return place
    return max(place for place, weight in enumerate(weights) if weight > 0)  # of sums that were rounded


def check_distributions(value: Any, path: str) -> None:
    """Check all distributions of a document, and the number of values that one draw can have.

    Raises:
        CmpDesignError: an unknown key, numbers that are no distribution, or too many values; the message begins with
            the path.
    """
    _check_value(value, path)
    most = _most_values(value)
    if most > MAX_VALUES:
        raise CmpDesignError(
            f"{path}: one draw can have {most:.4g} values; the limit is {MAX_VALUES}; make repeat smaller"
        )


def _most_values(value: Any) -> int:
    """The largest number of values that a draw of a checked value can have."""
    match distribution_kind(value):
        case "repeat":
            return max(_whole_numbers(value["repeat"]) or [0]) * _most_values(value["of"])
        case "choice":
            return max(map(_most_values, value["choice"]))
        case "chance":
            return _most_values(value["of"])
    inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, list | tuple) else ()
    return 1 + sum(map(_most_values, inner))


def is_drawn(table: Mapping[str, Any], key: str, place: int | None = None) -> bool:
    """Whether a draw can contain the value at a key of a checked table, or one of its choices.

    A distribution leaves a value out by a chance, a weight or a repeat of 0.
    """
    if key == "of" and "chance" in table:
        return bool(table["chance"] > 0)
    if key == "of" and "repeat" in table:
        return max(_whole_numbers(table["repeat"]) or [0]) > 0
    return place is None or table.get("weights") is None or bool(table["weights"][place] > 0)


def _check_value(value: Any, path: str) -> None:
    kind = distribution_kind(value)
    if kind is not None:
        _check_kind(kind, value, path)
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            _check_value(inner, f"{path}.{key}")
    elif isinstance(value, list | tuple):
        for place, inner in enumerate(value):
            if distribution_kind(inner) == "chance":
                raise CmpDesignError(
                    f"{path}.{place}: chance is not allowed in a list; use repeat for a list"
                )
            _check_value(inner, f"{path}.{place}")


def _check_kind(kind: str, table: Mapping[str, Any], path: str) -> None:
    strange = sorted(table.keys() - {kind} - KINDS[kind])
    if strange:
        allowed = ", ".join([kind, *sorted(KINDS[kind])])
        raise CmpDesignError(f"{path}: {strange[0]} is not allowed with {kind}; there are {allowed}")
    if "of" in KINDS[kind]:
        if "of" not in table:
            raise CmpDesignError(f"{path}: {kind} needs of, the value that is repeated or may be absent")
        _check_value(table["of"], path)
    given = table[kind]
    match kind:
        case "choice":
            _check_choice(table, path)
        case "chance":
            _require(_is_number(given) and 0 <= given <= 1, path, kind, given, "a number from 0 to 1")
        case "repeat":
            counts = _whole_numbers(given)
            good = counts is not None and all(0 <= count <= MAX_REPEATS for count in counts)
            limit = (
                f"a whole number from 0 to {MAX_REPEATS}, or {{whole = [...]}} or {{choice = [...]}} of them"
            )
            _require(good, path, kind, given, limit)
        case _:
            _check_pair(kind, given, path)


def _check_choice(table: Mapping[str, Any], path: str) -> None:
    given, weights = table["choice"], table.get("weights")
    _require(isinstance(given, list) and bool(given), path, "choice", given, "a list of one value or more")
    for inner in given:
        _check_value(inner, path)
    if weights is not None:
        good = isinstance(weights, list) and len(weights) == len(given)
        good = good and all(_is_number(weight) and weight >= 0 for weight in weights) and sum(weights) > 0
        limit = f"{len(given)} numbers of 0 or more, one for each value, not all 0"
        _require(good, path, "weights", weights, limit)


def _check_pair(kind: str, given: Any, path: str) -> None:
    pair = isinstance(given, list) and len(given) == 2 and all(map(_is_number, given))
    if kind == "normal":
        _require(pair and given[1] >= 0, path, kind, given, "[mean, deviation], the deviation 0 or more")
        return
    low = "0 < low <= high" if kind == "log_uniform" else "low <= high"
    good = pair and given[0] <= given[1] and (kind != "log_uniform" or given[0] > 0)
    if kind == "whole":
        good = good and all(isinstance(end, int) for end in given)
        low += ", whole numbers"
    _require(good, path, kind, given, f"[low, high] with {low}")


def _whole_numbers(value: Any) -> list[int] | None:
    """The smallest and the largest whole number of a value; None if the value can be of another kind."""
    if isinstance(value, int) and not isinstance(value, bool):
        return [value]
    match distribution_kind(value):
        case "whole":
            _check_kind("whole", value, "")
            return list(value["whole"])
        case "choice" if isinstance(value["choice"], list):
            found = [_whole_numbers(inner) for inner in value["choice"]]
            return None if None in found else [end for inner in found for end in inner or []]
    return None


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _require(good: bool, path: str, key: str, value: object, limit: str) -> None:
    if not good:
        raise CmpDesignError(f"{path}: {key} is {shown_value(value)}; it must be {limit}")


def varying_leaves(value: Any, path: str = "", varies: bool = False) -> Iterator[tuple[str, Any]]:
    """(dotted path, an example or a type) of every scalar that differs from frame to frame, lists by their places.

    Repeated values and entries that may be absent have no fixed place: for a ``repeat`` there is the path with
    ".count" alone.

    Yields:
        A path may come several times, once for each alternative of a choice.
    """
    kind = distribution_kind(value)
    if kind in ("uniform", "log_uniform", "normal", "whole"):
        yield path, 0.0
    elif kind == "choice":
        for inner in value["choice"]:
            yield from varying_leaves(inner, path, True)
    elif kind == "repeat":
        yield f"{path}.count", 0.0
    elif kind == "chance":
        yield from varying_leaves(value["of"], path, True)
    elif isinstance(value, Mapping):
        for key, inner in value.items():
            yield from varying_leaves(inner, f"{path}.{key}" if path else str(key), varies)
    elif isinstance(value, list | tuple):
        for place, inner in enumerate(value):
            yield from varying_leaves(inner, f"{path}.{place}", varies)
    elif varies:
        yield path, value


def value_at(document: Any, path: str) -> Any:
    """The value at a dotted path of a drawn document; None without a value; the length of a list at ".count"."""
    for part in path.split("."):
        if isinstance(document, Mapping):
            document = document.get(part)
        elif isinstance(document, list):
            if part == "count":
                return len(document)
            document = document[int(part)] if part.isdecimal() and int(part) < len(document) else None
        else:
            return None
    return document
