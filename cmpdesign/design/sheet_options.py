"""The [sheet] table of a design: the page that pads are printed on."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from cmpdesign.design.quantities import LengthOrZero

PAGES_MM = {"a4": (210.0, 297.0), "a3": (297.0, 420.0), "letter": (215.9, 279.4)}


class SheetOptions(BaseModel):
    """Parameters of the print sheet."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    page: Literal["a4", "a3", "letter"] = Field("a4", description="Paper size.")
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
