"""What the names of pictures say: times, frame numbers, or nothing. One rule for all pictures of a source.

- A number of seconds since 1970 with or without decimals, or of milli-, micro- or nanoseconds: times. Decimals are read
  as such: "1700000000.15" comes before "1700000000.1834567".
- A name that is nothing but a decimal number, as "0.033": seconds.
- Another last number that differs from name to name: the frame's number.

All names must agree but for that number.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Literal

NS_PER_S = 10**9
_FIRST_UNIX_S, _LAST_UNIX_S = 10**9, 4 * 10**9  # the years 2001 to 2096
_UNIX_DIGITS = {10: NS_PER_S, 13: 10**6, 16: 10**3, 19: 1}  # digits of a time since 1970 -> ns of its unit
_MAX_SPREAD = (
    100  # numbers that span more than this multiple of their count are no frame numbers, but dates or codes
)

_NUMBER = re.compile(r"(.*?)(\d+)(\D*)", re.ASCII | re.DOTALL)
_UNIX = re.compile(r"(.*?)(?<!\d)(\d{10})(?:([._-])(\d{1,9})\d*)?(\D*)", re.ASCII | re.DOTALL)
_SECONDS = re.compile(r"(\d+)\.(\d+)", re.ASCII)

NameKind = Literal["unix", "seconds", "numbers"]


@dataclass(frozen=True)
class NamedTimes:
    """The meaning of the names of pictures.

    Attributes:
        kind: "unix": ns since 1970; "seconds": ns from any start; "numbers": frame numbers.
        values: one for each picture.
    """

    kind: NameKind
    values: tuple[int, ...]

    @property
    def missing(self) -> int:
        """Frame numbers that are left out, counted in the numbers' common step."""
        step = math.gcd(*(b - a for a, b in pairwise(self.values))) or 1
        return (self.values[-1] - self.values[0]) // step + 1 - len(self.values)


def read_names(paths: Sequence[Path]) -> NamedTimes | None:
    """What the names say; None if there is one picture, or if the names follow no rule.

    The values may be in any order; two pictures never have the same.
    """
    stems = [path.stem for path in paths]
    if len(stems) < 2:
        return None
    for read in (_unix_times, _seconds, _numbers):
        found = read(stems)
        if found is not None and len(set(found.values)) == len(stems):
            if found.kind != "unix" and len({path.parent for path in paths}) > 1:
                return None
            return found
    return None


def in_order_of_names(paths: Sequence[Path]) -> list[Path]:
    """The pictures by what their names say; unchanged where the names say nothing."""
    named = read_names(paths)
    if named is None:
        return list(paths)
    return [path for _, path in sorted(zip(named.values, paths, strict=True), key=lambda pair: pair[0])]


def _unix_times(stems: Sequence[str]) -> NamedTimes | None:
    found = [match for stem in stems if (match := _UNIX.fullmatch(stem))]
    if len(found) == len(stems) and len({(match[1], match[5]) for match in found}) == 1:
        is_decimal = {match[3] for match in found} <= {".", None}
        widths = {len(match[4] or "") for match in found}
        values = tuple(int(match[2]) * NS_PER_S + int((match[4] or "").ljust(9, "0")) for match in found)
        if (is_decimal or len(widths) == 1) and _are_unix(values):
            return NamedTimes("unix", values)
    numbers = [match for stem in stems if (match := _NUMBER.fullmatch(stem))]
    if len(numbers) == len(stems) and len({(match[1], match[3], len(match[2])) for match in numbers}) == 1:
        unit = _UNIX_DIGITS.get(len(numbers[0][2]))
        values = tuple(int(match[2]) * (unit or 0) for match in numbers)
        if unit and _are_unix(values):
            return NamedTimes("unix", values)
    return None


def _are_unix(values: Sequence[int]) -> bool:
    return all(_FIRST_UNIX_S <= value // NS_PER_S <= _LAST_UNIX_S for value in values)


def _seconds(stems: Sequence[str]) -> NamedTimes | None:
    """Decimal numbers; not "1.9", "1.10", whose last parts are counted."""
    found = [match for stem in stems if (match := _SECONDS.fullmatch(stem))]
    decimals = [match[2] for match in found]
    is_counted = len(set(map(len, decimals))) > 1 and any(
        text.endswith("0") and text != "0" for text in decimals
    )
    if len(found) < len(stems) or is_counted or any(len(text) > 12 for text in decimals):
        return None
    return NamedTimes(
        "seconds", tuple(int(match[1]) * NS_PER_S + int(match[2][:9].ljust(9, "0")) for match in found)
    )


def _numbers(stems: Sequence[str]) -> NamedTimes | None:
    found = [match for stem in stems if (match := _NUMBER.fullmatch(stem))]
    if len(found) < len(stems) or len({(match[1], match[3]) for match in found}) > 1:
        return None
    values = tuple(int(match[2]) for match in found)
    if max(values) - min(values) >= _MAX_SPREAD * len(values):
        return None
    return NamedTimes("numbers", values)
