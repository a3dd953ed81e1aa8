"""Options of calls: each is stated once, with its type, its default and how the command line writes it."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeVar, cast, get_args, get_origin, get_type_hints

from cmpdesign.errors import CmpDesignError, InputError, parameter

# As in the extractor, which these modules do not load; a test compares both.
Preset = Literal["balanced", "accurate"]
Side = Literal["designed", "front", "back", "either"]
Channels = Literal["bgr", "rgb"]
Make = Literal["laser", "mold", "print"]
Response = Literal["srgb", "linear"] | float
Options = TypeVar("Options")
_SIZE = re.compile(r"\s*(\d{1,6})\s*[xX×]\s*(\d{1,6})\s*", re.ASCII)


@dataclass(frozen=True, kw_only=True)
class Written:
    """How the command line writes a parameter of a call, the second part of its annotation.

    Attributes:
        metavar: what stands for the value in help texts; None: its type.
        least: smallest value; None: none.
        most: largest value, of a size the largest side; None: none.
        above: the value must be above this number; None: none.
        name: name on the command line, if it differs, as "--live-wait".
        needed: the command line requires the value, unlike the call, or does not; None: as the call does.
        with_commas: several values are one text.
        example: a value, for the message on a text that is none.
    """

    metavar: str | None = None
    least: float | None = None
    most: float | None = None
    above: float | None = None
    name: str | None = None
    needed: bool | None = None
    with_commas: bool = False
    example: str = ""


@dataclass(frozen=True)
class Usual(Written):
    """The default of a key of a record of options, and how the command line writes the key.

    Attributes:
        value: the default.
    """

    value: Any


@dataclass(frozen=True)
class Option:
    """One option of a call: its name, its type and its ``Usual``."""

    name: str
    type: Any
    usual: Usual


def pixels_of(name: str, given: str | Sequence[int], most: int = 99_999) -> tuple[int, int]:
    """Width and height in px from a text as "640x480" or "640 X 480", or from two whole numbers.

    Args:
        name: the call's parameter, for the message.
        given: its value.
        most: largest width and height.

    Raises:
        InputError: another value, or a side that is not from 10 to ``most``.
    """
    found = _SIZE.fullmatch(given) if isinstance(given, str) else None
    sides = tuple(map(int, found.groups())) if found else given
    if len(sides) == 2 and all(isinstance(side, int) and 10 <= side <= most for side in sides):
        return int(sides[0]), int(sides[1])
    raise InputError(f"{parameter(name)} {given}: expected WIDTHxHEIGHT, 10 to {most} px each, as in 640x480")


def options_of(record: type) -> list[Option]:
    """The options of a ``TypedDict`` whose keys are annotated with ``Usual``, in their order."""
    hints = get_type_hints(record, include_extras=True)
    found = []
    for name, hint in hints.items():
        assert get_origin(hint) is Annotated, f"{record.__name__}.{name} has no default"
        kind, usual = get_args(hint)
        found.append(Option(name, kind, usual))
    return found


def settled(record: type[Options], given: Mapping[str, Any]) -> Options:
    """All options: the given values, and the defaults of the others.

    Raises:
        TypeError: a name that the record does not have.
        CmpDesignError: a number that is too small or not finite.
    """
    known = {option.name: option for option in options_of(record)}
    for name in given:
        if name not in known:
            raise TypeError(f"{name} is no option; there are {', '.join(known)}")
    values = {name: given.get(name, option.usual.value) for name, option in known.items()}
    for name, value in values.items():
        _require_within(name, value, known[name].usual)
    return cast(Options, values)


def _require_within(name: str, value: Any, usual: Usual) -> None:
    if value is None:
        return
    if isinstance(value, float) and not math.isfinite(value) and usual.above is usual.least is None:
        raise CmpDesignError(f"{parameter(name)} is {value}; expected a finite number")
    if usual.above is not None and not usual.above < value < float("inf"):
        raise CmpDesignError(f"{parameter(name)} is {value:g}; expected a number above {usual.above:g}")
    if usual.least is not None and not usual.least <= value < float("inf"):
        raise CmpDesignError(f"{parameter(name)} is {value:g}; expected a number from {usual.least:g}")
