"""Values on the command line that are written in a form of their own: sizes, responses, pairs."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.options import Response, Written


def parse_pixels(option: str, text: str, largest: int) -> tuple[int, int]:
    """Width and height from "640x480" or "640 X 480".

    Args:
        option: name of the option, for the message.
        text: its value.
        largest: largest width and height, px.

    Raises:
        CmpDesignError: another text, or a side that is not from 10 to ``largest``.
    """
    match = re.fullmatch(r"\s*(\d{1,6})\s*[xX×]\s*(\d{1,6})\s*", text, re.ASCII)
    sides = (int(match[1]), int(match[2])) if match else (0, 0)
    if min(sides) < 10 or max(sides) > largest:
        raise CmpDesignError(
            f"{option} {text}: expected WIDTHxHEIGHT, 10 to {largest} pixels each, as in 640x480"
        )
    return sides


def parse_pairs(option: str, texts: Sequence[str], key: type, written: Written) -> dict[Any, str]:
    """Key -> value from texts as "pitch_mm=60mil" or "0.5mm=plate.png".

    Args:
        option: name of the option, for the messages.
        texts: its values.
        key: type of the keys: str or float, which may end with "mm".
        written: the form and the example of the messages.

    Raises:
        CmpDesignError: a text without key or value, a key that is no finite number, or a number that is given twice.
    """
    pairs: dict[Any, str] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        try:
            found: Any = name if key is str else float(name.removesuffix("mm"))
        except ValueError:
            found = math.nan
        is_known = bool(name) if key is str else math.isfinite(found) and value
        if not equals or not is_known:
            raise CmpDesignError(f"{option} {text}: expected {written.metavar}, as in {written.example}")
        if key is float and found in pairs:
            raise CmpDesignError(f"{option} {text}: {found:g} is given twice")
        pairs[found] = value
    return pairs


def parse_response(text: str) -> Response:
    """The response from "srgb", "linear" or an exponent.

    Raises:
        CmpDesignError: another text, or an exponent beyond its limits.
    """
    if text == "srgb":
        return "srgb"
    if text == "linear":
        return "linear"
    try:
        exponent = float(text)
    except ValueError:
        raise CmpDesignError(
            f"--response {text}: expected srgb, linear or an exponent from 0.2 to 5, as in 2.2"
        ) from None
    from extractor.image.response import light_of_values

    try:
        light_of_values(exponent)
    except ValueError as error:
        raise CmpDesignError(f"--response {text}: {error}") from None
    return exponent


def parse_reading_response(text: str | None) -> Response | None:
    """As ``parse_response``; None where the option is not given: the response follows from the image's depth."""
    return None if text is None else parse_response(text)
