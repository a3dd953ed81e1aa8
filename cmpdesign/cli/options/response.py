"""The option ``--response``: the relation between light and the values of an image."""

from __future__ import annotations

from typing import Literal

from cmpdesign.errors import CmpDesignError

METAVAR = "srgb|linear|EXPONENT"
READING_HELP = (
    "Response of the camera; with an exponent, light is value ** exponent. [default: srgb; 16 bits linear]"
)


def parse_response(text: str) -> Literal["srgb", "linear"] | float:
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


def parse_reading_response(text: str | None) -> Literal["srgb", "linear"] | float | None:
    """As ``parse_response``; None where the option is not given: the response follows from the image's depth."""
    return None if text is None else parse_response(text)
