"""Image sizes on the command line."""

from __future__ import annotations

import re

from cmpdesign.errors import CmpDesignError


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
