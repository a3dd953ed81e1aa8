"""The key of a print sheet: a QR code and two scale bars at fixed places, by which a scan is read.

        |            y bar, 50 mm
        |
    +-------+
    |  QR   |
    |       |  -----------------   x bar, 50 mm
    +-------+

Places are in mm from the code's upper left corner, x right, y down. One definition for writer and reader.
"""

from __future__ import annotations

from dataclasses import dataclass

BAR_MM = 50.0
THICK_MM = 1.2
CODE_MM = 24.0
# First and last end of each bar's middle line.
X_BAR = ((30.0, 20.0), (30.0 + BAR_MM, 20.0))
Y_BAR = ((4.0, -6.0), (4.0, -6.0 - BAR_MM))
KEY_PREFIX = "CMP1"


@dataclass(frozen=True)
class SheetKey:
    """What the code says.

    Attributes:
        digest: the layout's, 64 hexadecimal digits.
        name: the design's.
        pattern: the pattern's name.
        layers: their number.
        pitch_mm: the pitch.
    """

    digest: str
    name: str
    pattern: str
    layers: int
    pitch_mm: float

    def text(self) -> str:
        """The code's text; the name comes last, since it may hold anything."""
        return f"{KEY_PREFIX}|{self.digest}|{self.pattern}|{self.layers}|{self.pitch_mm!r}|{self.name}"


def parse_key(text: str) -> SheetKey | None:
    """The key in a code's text; None when it is some other code."""
    parts = text.split("|", 5)
    if len(parts) != 6 or parts[0] != KEY_PREFIX:
        return None
    try:
        return SheetKey(parts[1], parts[5], parts[2], int(parts[3]), float(parts[4]))
    except ValueError:
        return None
