"""The [laser] table of a design. Missing values come from the machine's and the material's files."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from cmpdesign.design.quantities import Angle, Length, LengthOrZero
from cmpdesign.inputs.names import Line

Share = Annotated[float, Field(gt=0, le=100)]
Speed = Annotated[float, Field(gt=0, le=20_000)]
Passes = Annotated[int, Field(ge=1, le=200, strict=True)]


class LaserOptions(BaseModel):
    """Parameters of the laser job. Lengths in mm, angles in degrees, speeds in mm/s, power in percent."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    machine: Line = Field("co2-40w", min_length=1, description="A machine's name or TOML file.")
    material: Line = Field("silicone-black", min_length=1, description="A material's name or TOML file.")

    mode: Literal["cut", "pocket"] = Field(
        "cut", description='"cut": outlines, through the sheet. "pocket": filled, to a depth.'
    )
    corner: Literal["plain", "overcut"] = Field(
        "overcut",
        description="Corners: rounded, or with a short spur that balances the lost area.",
    )
    order: Literal["travel", "heat", "given"] = Field(
        "travel",
        description="Order of the cells: short travel, long times between neighbours, or as in the layout.",
    )
    face: Literal["front", "middle", "back"] | None = Field(
        None,
        description="Face at which a cell has its nominal size when the beam tapers; else the side that the camera "
        "sees.",
    )
    fill: Literal["hatch", "offset"] = Field("hatch", description="Pocket: parallel lines or rings.")
    hatch_mm: Length | None = Field(None, description="Pocket: pitch of lines or rings, else half the kerf.")
    hatch_deg: Angle = Field(0.0, description="Pocket: direction of the first pass' lines.")
    hatch_turn_deg: Angle = Field(67.0, description="Pocket: turn of the lines from pass to pass.")
    depth_mm: Length | None = Field(None, description="Depth of the cavities; else the material's thickness.")

    kerf_mm: LengthOrZero | None = Field(
        None,
        description="Kerf at the front, in both directions; instead of x and y. 0: paths are not compensated.",
    )
    kerf_x_mm: Length | None = Field(None, description="Width of a cut that runs in y, at the front.")
    kerf_y_mm: Length | None = Field(None, description="Width of a cut that runs in x, at the front.")
    taper_deg: Angle | None = Field(
        None, description="Angle of each wall; positive: the cut narrows towards the back."
    )
    power_percent: Share | None = Field(None, description="Power in percent of the machine's power.")
    speed_mm_s: Speed | None = Field(None, description="Speed with the beam on.")
    passes: Passes | None = Field(None, description="Number of times that the beam runs over every path.")
    minimum_web_mm: LengthOrZero | None = Field(None, description="The narrowest wall that does not break.")

    holes: bool = Field(True, strict=True, description="First job: the fiducials as pin holes.")
    outline: bool = Field(False, strict=True, description="Last job: the pad, cut out along its outline.")
    x_mm: LengthOrZero | None = Field(None, description="The job's left edge on the bed; else centred.")
    y_mm: LengthOrZero | None = Field(None, description="The job's lower edge on the bed; else centred.")

    @model_validator(mode="after")
    def _one_kerf(self) -> LaserOptions:
        if self.kerf_mm is not None and (self.kerf_x_mm is not None or self.kerf_y_mm is not None):
            raise ValueError("kerf_mm and kerf_x_mm or kerf_y_mm fix the kerf twice; leave one out")
        return self
