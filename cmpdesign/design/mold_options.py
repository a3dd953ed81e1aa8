"""The [mold] table of a design."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from cmpdesign.design.quantities import Angle, Length, LengthOrZero
from cmpdesign.inputs.names import Line

Tool = Literal["sla-resin", "fdm-pla", "fdm-petg", "aluminium", "steel"]
Count = Annotated[int, Field(ge=0, le=64, strict=True)]


class MoldOptions(BaseModel):
    """Parameters of the molds. Lengths in mm (layers: as cured), angles in degrees."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    tool: Tool = Field("sla-resin", description="Tool that makes the parts.")
    base_silicone: Line = Field(
        "solaris", min_length=1, description="Silicone of the clear base layer: name or TOML file."
    )
    marker_silicone: Line = Field(
        "dragon-skin-10",
        min_length=1,
        description="Silicone of the black layer and its fillings: name or TOML file.",
    )
    cover_silicone: Line = Field("dragon-skin-10", min_length=1, description="Protective layer.")

    base_mm: Length = Field(4.0, description="Thickness of the clear base layer.")
    marker_mm: Length = Field(0.5, description="Thickness of the black layer with the pattern.")
    cover_mm: Length = Field(0.5, description="Thickness of the protective layer.")

    draft_deg: Angle = Field(
        2.0,
        description="Draft angle of every wall that the silicone is pulled from; cells widen away from the camera.",
    )
    tip_radius_mm: LengthOrZero = Field(0.05, description="Radius of a boss's upright edges at its tip.")
    gap_mm: LengthOrZero = Field(
        0.02, description="Smallest black web between neighbouring cells, at the open side of the cavities."
    )
    minimum_feature_mm: Length | None = Field(
        None, description="Smallest feature of the nozzle, beam or cutter; else the usual value of the tool."
    )

    crown: Literal["none", "sphere", "cylinder"] = Field("none", description="Shape of a domed pad.")
    crown_radius_mm: Length | None = Field(None, description="Radius of the crown.")
    projection: Literal["equidistant", "vertical"] = Field(
        "equidistant",
        description="Mapping of the pattern onto the crown: lengths from the apex kept, or shape as seen from above "
        "kept.",
    )

    floor_mm: Length = Field(3.0, description="Tray's floor.")
    plate_mm: Length = Field(3.0, description="Thickness of boss plates and lid.")
    stencil_mm: Length = Field(0.5, description="Stencils.")
    wall_mm: Length = Field(3.0, description="Distance from a pin hole or the moat to the parts' outer edge.")
    fillet_mm: LengthOrZero = Field(2.0, description="Radius of the parts' upright outer edges.")
    clearance_mm: Length = Field(
        0.1, description="Diameter of a hole less the pin's; gap between stencil and cavity on each side."
    )
    pin_diameter_mm: Length | None = Field(
        None, description="Diameter of the dowel pins; else the fiducials' diameter."
    )
    vents: Count = Field(6, description="Number of vents through the lid, along the pad's edge.")
    vent_mm: Length = Field(0.6, description="Diameter of a vent.")
    parting_mm: Length = Field(
        0.8, description="Width of the land that seals at the parting line, between pad and moat."
    )
    moat_mm: Length = Field(0.8, description="Width of the overflow moat.")
    moat_depth_mm: Length = Field(1.0, description="Depth of the overflow moat.")
