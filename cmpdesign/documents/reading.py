"""Documents of the commands that read pictures one by one."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from cmpdesign.documents.document import Document, DocumentPart


class QualityPart(DocumentPart):
    """Properties of a picture; null where unknown."""

    blur_px: float | None = Field(description="Sigma of the Gaussian that optics and pixel make together.")
    noise: float | None = Field(description="Standard deviation of the noise, in 255ths.")
    contrast: float | None = Field(description="Color difference of the two inks that differ least, CIE76.")
    clipping: float | None = Field(description="Share of the cells that are overexposed.")
    evenness: float | None = Field(description="Evenness of the light, 0 to 1.")
    edge_px: float | None = Field(description="Median length of a gridline, px.")
    weakest_inks: tuple[str, ...]
    row_fault: Literal["torn", "rolling shutter"] | None = Field(
        None, description="A break of the image along a row."
    )
    row_jump_px: float | None = Field(None, description="How far the image jumps there, px.")
    hints: tuple[str, ...] = Field(description="Causes that limit the result, with remedies.")


class SheetPart(DocumentPart):
    """Measurements of a picture of a print sheet."""

    name: str
    digest: str
    length_x_px: float = Field(description="Length of the bar along x.")
    length_y_px: float
    scale_x: float | None = Field(description="Printed over designed; null without a known resolution.")
    scale_y: float | None
    ratio: float = Field(description="scale_x / scale_y.")
    skew_deg: float = Field(description="Angle between the bars, less 90 degrees.")
    rotation_deg: float = Field(description="Clockwise turn of the bar along x in the picture.")
    perspective_mm: float = Field(description="Distance of a bar's end from the best affine map.")
    dpi: tuple[float, ...] | None
    note: str | None


class ImagePart(DocumentPart):
    """The verdict on one picture. Fields that do not apply are not set: of unread pictures, or of print sheets."""

    image: str = Field(description="Path of the picture, or the name of a source and the number of a frame.")
    verified: bool
    error: str | None = Field(None, description="Why the picture could not be read.")
    reason: str | None = Field(None, description="Why the picture is not verified.")
    present: int | None = Field(None, description="Markers that are visible in the layout.")
    measured: int | None = None
    repaired: int | None = None
    fitted: int | None = None
    lost: int | None = None
    share: float | None = Field(None, description="measured / present.")
    mirrored: bool | None = Field(None, description="The picture shows the pattern's back.")
    code: int | None = Field(None, description="Id of the code of the pad that the picture shows.")
    contradictions: tuple[int, ...] | None = Field(
        None, description="Cells whose color contradicts the layout."
    )
    quality: QualityPart | None = None
    timings_ms: dict[str, float] | None = Field(None, description="Stage -> time, ms.")
    sheet: SheetPart | None = Field(None, description="Measurements, if the picture shows a print sheet.")


class VerifyDocument(Document):
    """The verdicts of ``verify``; also the file verify.json."""

    format: Literal["cmp-verification"] = "cmp-verification"
    version: Literal[1] = 1
    pattern: str
    digest: str = Field(description="Digest of the layout; of several, of the first.")
    codes: tuple[int, ...] | None = Field(None, description="Codes of the layouts, if there are several.")
    min_share: float
    verified: bool = Field(description="True if all pictures are verified.")
    images: tuple[ImagePart, ...]

    def to_json(self) -> str:
        """The text of the document, without the fields that do not apply."""
        return self.model_dump_json(indent=2, exclude_unset=True) + "\n"


class PatchPart(DocumentPart):
    """The kerfs of one patch of a coupon; x of cuts along y, y of cuts along x."""

    name: str
    power_percent: float
    speed_mm_s: float
    passes: int
    kerf_x_mm: float = Field(description="Kerf at the front, as in a material's file.")
    kerf_x_back_mm: float
    kerf_x_sigma_mm: float
    kerf_y_mm: float
    kerf_y_back_mm: float
    kerf_y_sigma_mm: float


class KerfDocument(Document):
    """What ``kerf`` measured."""

    format: Literal["cmp-kerf"] = "cmp-kerf"
    version: Literal[2] = 2
    from_back: bool = Field(description="The picture shows the sheet's back.")
    face: Literal["front", "back"] = Field(description="The face whose openings are seen.")
    taper_deg: float
    taper_assumed: bool
    thickness_mm: float
    response: str
    scale_px_mm: float = Field(description="Scale, px per mm.")
    fit_mm: float = Field(description="RMS residual of the coupon's marks.")
    patches: tuple[PatchPart, ...]


class GridFieldPart(DocumentPart):
    """One power and speed of a grid."""

    name: str
    power_percent: float
    speed_mm_s: float
    windows: dict[int, Literal["through", "marked", "unmarked"]] = Field(
        description="Passes -> what is seen."
    )
    depths_mm: dict[int, tuple[float, float]] = Field(
        description="Passes -> least and most depth, by the windows that are cut through; open: the thickness."
    )
    passes: int | None = Field(description="Fewest passes that cut through; null: none.")
    least_depth_per_pass_mm: float = Field(
        description="By this field and by those of less power or more speed."
    )
    most_depth_per_pass_mm: float | None = Field(
        description="By this field and by those of more power or less speed; null: no window gives a limit."
    )


class GridDocument(Document):
    """What ``kerf`` read in the picture of a grid."""

    format: Literal["cmp-grid"] = "cmp-grid"
    version: Literal[1] = 1
    scale_px_mm: float = Field(description="Scale, px per mm.")
    from_back: bool = Field(description="The picture shows the sheet's back.")
    best: str | None = Field(description="The quickest field that cuts through with a pass in reserve.")
    fields: tuple[GridFieldPart, ...]


class CalibratePatternDocument(Document):
    """The result of ``calibrate pattern``."""

    format: Literal["cmp-calibration-pattern"] = "cmp-calibration-pattern"
    version: Literal[1] = 1
    written: str
    pictures: int
    side: Literal["front", "back"]
    present: int = Field(description="Markers that are visible in the layout.")
    measured: int
    residual_z: float = Field(description="Residuals in stated deviations; 1 is right.")
    worst_picture: int = Field(description="Number of the picture with the largest residuals, from 0.")
    worst_picture_z: float
    worst_picture_rms_px: float
    scatter_mm: float = Field(description="Scatter of the markers around their nominal places, per axis.")
    deviation_mm: float = Field(description="Standard deviation of a measured place, per axis.")


class CalibrateGelDocument(Document):
    """The result of ``calibrate gel``."""

    format: Literal["cmp-calibration-gel"] = "cmp-calibration-gel"
    version: Literal[1] = 1
    written: str
    digest: str = Field(description="Digest of layout and elastomer, without Young's modulus.")
    markers: int
    loads: int
    thickness_mm: float
    poisson: float
    marker_depth_mm: float
    margin_mm: float


class CalibrateForceDocument(Document):
    """The result of ``calibrate force``."""

    format: Literal["cmp-calibration-force"] = "cmp-calibration-force"
    version: Literal[1] = 1
    young_mpa: float
    young_sigma_mpa: float
    bias_n: float = Field(description="Force that is read without a weight.")
    bias_sigma_n: float
    residual_z: float = Field(description="Residuals in stated deviations; 1 is right.")
    weights: int = Field(description="Number of different masses.")
