"""Documents of the commands that calibrate cameras and rigs."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from cmpdesign.documents.document import Document, DocumentPart


class CalibrationPicturePart(DocumentPart):
    """One picture of a calibration."""

    picture: str
    points: int = Field(description="Markers measured.")
    rms_px: float | None = Field(description="RMS residual per axis; null for a picture that is not read.")
    cause: str = Field(description="Why the picture is left out; empty for a picture that is used.")


class CalibrateCameraDocument(Document):
    """The result of ``calibrate camera``."""

    format: Literal["cmp-calibration-camera"] = "cmp-calibration-camera"
    version: Literal[1] = 1
    written: tuple[str, ...]
    size_px: tuple[int, int]
    model: str
    response: str | float = Field(
        description="Relation of light and values with which the pictures were read."
    )
    parameters: dict[str, float]
    deviations: dict[str, float] = Field(description="Standard deviations of the parameters.")
    held: tuple[str, ...] = Field(description="Parameters that the pictures do not determine.")
    rms_px: float = Field(description="RMS residual per axis.")
    scale: float = Field(description="Residuals over the stated deviations of the markers; 1 is right.")
    ray_px: float = Field(
        description="RMS deviation of the rays over the image, per axis, after a common turn."
    )
    sheet_bend_mm: float = Field(description="Height of the sheet's shape; 0 for a flat sheet.")
    further_view: str = Field(description="The view to add that would help most.")
    further_view_ray_px: float
    pictures: tuple[CalibrationPicturePart, ...]


class MirrorsPart(DocumentPart):
    """The mirrors of two views that share a camera."""

    views: tuple[str, str]
    normals: tuple[tuple[float, ...], tuple[float, ...]] = Field(
        description="In the camera's frame, for a camera that faces the pattern."
    )
    distances_mm: tuple[float, float] = Field(description="From the camera to each mirror's plane.")
    angle_deg: float = Field(description="Between the mirrors.")
    shift_mm: float = Field(
        description="Between the views along the line in which the mirrors meet; 0 is right."
    )


class CalibrateRigDocument(Document):
    """The result of ``calibrate rig``."""

    format: Literal["cmp-calibration-rig"] = "cmp-calibration-rig"
    version: Literal[1] = 1
    written: str
    pictures: int = Field(description="At rest.")
    steps_mm: tuple[float, ...]
    plate_markers: tuple[int, ...] = Field(description="Markers on the plate in each step.")
    parameters: dict[str, float] = Field(description="Of lenses and medium.")
    stated: dict[str, float] = Field(description="Their standard deviations before the pictures.")
    deviations: dict[str, float] = Field(
        description="Their standard deviations after, and those of the poses."
    )
    held: tuple[str, ...] = Field(description="Parameters that the pictures do not determine.")
    rms_px: dict[str, float] = Field(description="RMS residual per axis at rest, of each view.")
    scale: float = Field(description="Residuals over their stated deviations; 1 is right.")
    depth_share: float = Field(description="Standard deviation of the depth of a press, over the press.")
    mirrors: tuple[MirrorsPart, ...]


class CausePart(DocumentPart):
    """One possible cause of larger residuals."""

    cause: str
    left: float = Field(description="Residuals that the cause leaves, over those of the calibration.")
    changes: dict[str, float] = Field(description="What has changed, in the names' units.")
    likely: bool


class ViewStatePart(DocumentPart):
    """What the pictures of a view tell; null where unknown."""

    share_read: float = Field(description="Markers measured, of those of the pad.")
    blur_px: float | None = Field(description="Sigma of the blur, pixel included.")
    evenness: float | None = Field(description="Light of the dimmest twentieth over that of the brightest.")
    clipping: float | None = Field(description="Share of the colored cells that are overexposed.")
    contrast: float | None = Field(description="CIE76 color difference of the two inks that differ least.")
    hints: tuple[str, ...] = Field(description="What to change at light, focus or camera.")


class CameraStatePart(DocumentPart):
    """What a driver answers; null where it does not say."""

    settings: dict[str, Any] = Field(description="Of camera_size, camera_fps and so on.")
    notes: tuple[str, ...] = Field(description="Differences from what was asked, and what is automatic.")


class ForceScalePart(DocumentPart):
    """The scale of forces."""

    young_mpa: float | None
    young_sigma_mpa: float
    gel: str | None = Field(description="The file of calibrate gel, which is this pad's.")


class CalibrateCheckDocument(Document):
    """The result of ``calibrate check``."""

    format: Literal["cmp-calibration-check"] = "cmp-calibration-check"
    version: Literal[1] = 1
    holds: bool = Field(description="Whether the calibration still is true; else the exit code is 1.")
    misfit: float = Field(description="Residuals at rest over those of the calibration; 1 is right.")
    picture_misfits: dict[str, float] = Field(description="The same of each picture alone.")
    rms_px: dict[str, float] = Field(description="RMS residual per axis, of each view.")
    stated_px: dict[str, float] = Field(description="The same at the calibration; empty where unknown.")
    limit_px: float | None = Field(description="[limits] max_rest_error_px; null: by the misfit.")
    causes: tuple[CausePart, ...] = Field(description="The likeliest first.")
    steps: tuple[str, ...] = Field(description="What to do; empty where the calibration holds.")
    depth_error: float | None = Field(
        description="Relative error of depths by the likeliest cause; null where unknown."
    )
    views: dict[str, ViewStatePart] = Field(description="In the last picture, or the mean of live frames.")
    cameras: dict[str, CameraStatePart] = Field(description="Of live frames; empty for pictures.")
    force: ForceScalePart | None = Field(description="null without [elastomer].")
    ages_days: dict[str, int | None] = Field(description="Of each calibration; null without a date.")
