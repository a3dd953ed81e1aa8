"""The coupon: a test piece; the kerf is measured from the widths of its openings.

o                 o        o: fiducials, cut round; their centres do not depend on the kerf
  [] |   [] |   [] |       []: square; |, -: narrow slots, and the patch's name; the beam runs along the outlines,
   -      -      -         so each opening is one kerf wider than nominal
  [] |   [] |   [] |       columns: power; rows: repeats
   -      -      -
  v v v v v v              v: triangles of 1.5 mm, compensated for a range of kerfs, to compare by eye
o o               o        the fifth fiducial shows the orientation of the piece
"""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cmpdesign.errors import CmpDesignError, InputError
from cmpdesign.inputs.documents import parse_json
from cmpdesign.inputs.files import read_text
from cmpdesign.inputs.names import Name
from cmpdesign.inputs.validation import validation_message
from cmpdesign.products.laser.setup import LaserSetup

# Powers (columns) and repeats (rows), relative to the settings of the job.
POWER_SHARES = (0.8, 1.0, 1.2)
REPEAT_FACTORS = (1, 2)
# Kerfs for which the triangles are compensated.
KERFS_MM = (0.05, 0.09, 0.13, 0.17, 0.21, 0.25)
SQUARE_MM, SLOT_MM, SLOT_LENGTH_MM = 3.0, 0.3, 4.0
PATCH_MM, MARGIN_MM = (11.0, 10.0), 5.0
FIDUCIAL_MM, KEY_MM = 3.0, 7.0
TRIANGLE_MM = 1.5
LABEL_MM = 2.0
_MAX_BYTES = 1 << 20

Face = Literal["front", "back"]


@dataclass(frozen=True)
class Opening:
    """A rectangle: its centre, and the width and height of the path of the beam's centre."""

    x_mm: float
    y_mm: float
    width_mm: float
    height_mm: float


@dataclass(frozen=True)
class Patch:
    """Openings that are cut with the same settings."""

    name: str
    power_percent: float
    speed_mm_s: float
    passes: int
    openings: tuple[Opening, ...]


@dataclass(frozen=True)
class Coupon:
    """A coupon in its own frame: mm, x right, y up, origin at the lower left fiducial.

    Attributes:
        machine, material: names of machine and material.
        thickness_mm: thickness of the sheet, which the openings go through.
        taper_deg: angle of each wall against the beam; positive narrows towards the back.
        taper_assumed: the taper is an assumption of the material's file.
        fiducial_diameter_mm: diameter of the fiducials.
        fiducials_mm: (x, y) of the lower left, lower right, upper left and upper right fiducial, and of the fifth,
            right of the first.
        patches: the patches.
        kind: "kerf": openings that show the kerf. "grid": squares that show which settings cut through.
    """

    machine: str
    material: str
    thickness_mm: float
    taper_deg: float
    taper_assumed: bool
    fiducial_diameter_mm: float
    fiducials_mm: tuple[tuple[float, float], ...]
    patches: tuple[Patch, ...]
    kind: Literal["kerf", "grid"] = "kerf"

    @property
    def narrowing_mm(self) -> float:
        """Width of a cut at the front less its width at the back, by the taper."""
        return 2 * self.thickness_mm * math.tan(math.radians(self.taper_deg))

    @property
    def narrow_face(self) -> Face:
        """The face with the narrower openings, through which the ground is seen; the front without a taper."""
        return "back" if self.taper_deg > 0 else "front"


class CouponError(CmpDesignError, ValueError):
    """A file that does not describe a coupon."""


def design_coupon(setup: LaserSetup) -> Coupon:
    """Design the coupon of a machine and material: power and repeats around the settings of the job."""
    width, height = PATCH_MM[0] * len(POWER_SHARES), PATCH_MM[1] * len(REPEAT_FACTORS) + 4 * TRIANGLE_MM
    right, top = width + 2 * MARGIN_MM, height + 2 * MARGIN_MM
    patches = []
    for row, factor in enumerate(REPEAT_FACTORS):
        for column, share in enumerate(POWER_SHARES):
            x = MARGIN_MM + (column + 0.5) * PATCH_MM[0]
            y = MARGIN_MM + 4 * TRIANGLE_MM + (len(REPEAT_FACTORS) - row - 0.5) * PATCH_MM[1]
            patches.append(
                Patch(
                    name=f"{'ABC'[column]}{row + 1}",
                    power_percent=round(min(share * setup.cut_power_percent, 100.0), 3),
                    speed_mm_s=setup.cut_speed_mm_s,
                    passes=factor * setup.cut_repeats,
                    openings=(
                        Opening(x - 2.0, y + 1.5, SQUARE_MM, SQUARE_MM),
                        Opening(x + 2.5, y + 1.5, SLOT_MM, SLOT_LENGTH_MM),
                        Opening(x - 2.0, y - 2.5, SLOT_LENGTH_MM, SLOT_MM),
                    ),
                )
            )
    corners = ((0.0, 0.0), (right, 0.0), (0.0, top), (right, top), (KEY_MM, 0.0))
    return Coupon(
        machine=setup.machine.name,
        material=setup.material.name,
        thickness_mm=setup.material.thickness_mm.value,
        taper_deg=setup.taper_deg,
        taper_assumed="taper_deg" in setup.assumed,
        fiducial_diameter_mm=FIDUCIAL_MM,
        fiducials_mm=corners,
        patches=tuple(patches),
    )


def coupon_to_json(coupon: Coupon) -> str:
    """Format ``coupon.json``."""
    document = {"format": "cmp-coupon", "version": 1, "units": "mm", **asdict(coupon)}
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def load_coupon(path: str | Path) -> Coupon:
    """Read a ``coupon.json``.

    Raises:
        CouponError: the file cannot be read or does not describe a coupon; one line that names the field.
    """
    try:
        document = parse_json(read_text(path, _MAX_BYTES), str(path))
    except InputError as error:
        raise CouponError(
            f"{error}; expected a coupon.json as build writes it for the product laser"
        ) from None
    return parse_coupon(document, str(path))


class _StrictModel(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, strict=False)


class _OpeningFile(_StrictModel):
    x_mm: float = Field(ge=-1e4, le=1e4)
    y_mm: float = Field(ge=-1e4, le=1e4)
    width_mm: float = Field(gt=0, le=1e3)
    height_mm: float = Field(gt=0, le=1e3)


class _PatchFile(_StrictModel):
    name: Annotated[Name, Field(min_length=1, max_length=20)]
    power_percent: float = Field(gt=0, le=100)
    speed_mm_s: float = Field(gt=0, le=1e6)
    passes: int = Field(ge=1, le=1000)
    openings: list[_OpeningFile] = Field(min_length=1, max_length=100)


class _CouponFile(_StrictModel):
    format: str = Field(pattern="^cmp-coupon$")
    version: int = Field(ge=1, le=1)
    units: str = Field(pattern="^mm$")
    machine: Name
    material: Name
    thickness_mm: float = Field(gt=0, le=100)
    taper_deg: float = Field(gt=-45, lt=45)
    taper_assumed: bool
    fiducial_diameter_mm: float = Field(gt=0, le=100)
    fiducials_mm: list[tuple[float, float]] = Field(min_length=5, max_length=5)
    patches: list[_PatchFile] = Field(min_length=1, max_length=100)
    kind: Literal["kerf", "grid"] = "kerf"


def parse_coupon(document: Any, name: str) -> Coupon:
    """The coupon of the JSON object of a ``coupon.json``; ``name`` is for messages.

    Raises:
        CouponError: see ``load_coupon``.
    """
    try:
        data = _CouponFile.model_validate(document)
    except ValidationError as error:
        message = validation_message(error, _CouponFile)
        raise CouponError(f"{name}: {message}; expected a coupon.json as build writes it") from None
    patches = tuple(
        Patch(
            patch.name,
            patch.power_percent,
            patch.speed_mm_s,
            patch.passes,
            tuple(Opening(**opening.model_dump()) for opening in patch.openings),
        )
        for patch in data.patches
    )
    return Coupon(
        machine=data.machine,
        material=data.material,
        thickness_mm=data.thickness_mm,
        taper_deg=data.taper_deg,
        taper_assumed=data.taper_assumed,
        fiducial_diameter_mm=data.fiducial_diameter_mm,
        fiducials_mm=tuple(data.fiducials_mm),
        patches=patches,
        kind=data.kind,
    )
