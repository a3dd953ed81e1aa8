"""The key of a print sheet: a QR code and two scale bars at fixed places relative to the code.

        |            y bar, 50 mm
        |
    +-------+
    |  QR   |
    |       |  -----------------   x bar, 50 mm
    +-------+

Places are in mm from the upper left corner of the code, x right, y down. Writer and reader share this definition.
"""

from __future__ import annotations

from dataclasses import dataclass

BAR_MM = 50.0
THICK_MM = 1.2
CODE_MM = 24.0
# First and last end of each bar's middle line, mm.
X_BAR = ((30.0, 20.0), (30.0 + BAR_MM, 20.0))
Y_BAR = ((4.0, -6.0), (4.0, -6.0 - BAR_MM))
KEY_PREFIX = "CMP1"


@dataclass(frozen=True)
class SheetKey:
    """The content of the QR code.

    Attributes:
        digest: digest of the layout, 64 hexadecimal digits.
        name: name of the design.
        pattern: name of the pattern.
        layers: number of marker layers.
        pitch_mm: pitch of the pattern.
    """

    digest: str
    name: str
    pattern: str
    layers: int
    pitch_mm: float

    def text(self) -> str:
        """The text of the code; the name comes last, because a name may contain the separator."""
        return f"{KEY_PREFIX}|{self.digest}|{self.pattern}|{self.layers}|{self.pitch_mm!r}|{self.name}"


def parse_key(text: str) -> SheetKey | None:
    """Parse the text of a QR code; None if the text is not the key of a print sheet."""
    parts = text.split("|", 5)
    if len(parts) != 6 or parts[0] != KEY_PREFIX:
        return None
    try:
        return SheetKey(parts[1], parts[5], parts[2], int(parts[3]), float(parts[4]))
    except ValueError:
        return None
