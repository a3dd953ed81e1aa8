"""The [sheet] table of a design: the page that pads are printed on."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from cmpdesign.design.quantities import LengthOrZero

PAGES_MM = {
    "a5": (148.0, 210.0),
    "a4": (210.0, 297.0),
    "a3": (297.0, 420.0),
    "a2": (420.0, 594.0),
    "a1": (594.0, 841.0),
    "a0": (841.0, 1189.0),
    "letter": (215.9, 279.4),
    "legal": (215.9, 355.6),
    "tabloid": (279.4, 431.8),
}
LARGEST_PAGE_MM = 5000.0  # of a plotter's roll


def page_size_mm(page: str) -> tuple[float, float]:
    """Width and height of a page by its name, or by its size, such as "300x200mm".

    Raises:
        ValueError: neither a name nor a size.
    """
    if page in PAGES_MM:
        return PAGES_MM[page]
    found = re.fullmatch(r"(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?) ?mm", page)
    if found is None:
        raise ValueError(
            f'{page!r} is no page; there are {", ".join(PAGES_MM)}, and sizes such as "300x200mm" (width x height)'
        )
    width, height = float(found[1]), float(found[2])
    if max(width, height) > LARGEST_PAGE_MM:
        raise ValueError(f"{page} is longer than {LARGEST_PAGE_MM:g} mm; make the page smaller")
    return width, height


class SheetOptions(BaseModel):
    """Parameters of the print sheet."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    page: str = Field(
        "a4", description='Paper: a0 to a5, letter, legal, tabloid, or width and height, such as "300x200mm".'
    )
    pads: Annotated[int, Field(ge=1, le=10_000, strict=True)] | None = Field(
        None, description="Number of pads; else as many as fit."
    )
    film: Literal["opaque", "clear"] | None = Field(
        None,
        description="Print on the side that the camera sees (opaque), or behind a clear film; else opaque for a "
        "visible front, clear for a visible back.",
    )
    bleed_mm: LengthOrZero = Field(
        2.0, description="Width of the black ground that is printed beyond the cut."
    )
    dot_gain_mm: LengthOrZero = Field(
        0.02, description="Width by which the black spreads into the cells, for the pad as made; assumed."
    )
    ruler: bool = Field(
        False,
        strict=True,
        description="Print a ruler line with millimetres, to measure the print's scale by hand.",
    )

    @field_validator("page")
    @classmethod
    def _known_page(cls, value: str) -> str:
        page_size_mm(value)
        return value
