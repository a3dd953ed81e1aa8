"""Documents of the commands that run from a source, and of the commands that export runs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from cmpdesign.documents.document import Document, DocumentPart
from cmpdesign.documents.reading import QualityPart

if TYPE_CHECKING:
    from numpy.typing import NDArray


class FramesPart(DocumentPart):
    """Numbers of frames."""

    declared: int | None = Field(description="Number of frames that the source states; null where unknown.")
    read: int
    tracked: int
    lost: int = Field(description="Frames without a pattern.")
    unreadable: int
    other_size: int


class SharesPart(DocumentPart):
    """Shares of markers by their status, over all frames."""

    measured: float
    repaired: float
    lost: float


class RestPart(DocumentPart):
    """The rest frame."""

    markers: int
    mm_per_px: float | None
    residual_mm: float | None


class LargestPart(DocumentPart):
    """The largest displacement of a run."""

    px: float | None = None
    mm: float | None
    frame: int
    marker: int


class LivePart(DocumentPart):
    """The counts of a live server."""

    address: str
    sent: int = Field(description="Sent frames.")
    left_out: int = Field(description="Frames that could not be sent in time.")
    is_viewer_behind: bool = Field(
        description="True if a viewer received fewer messages than the server sent."
    )
    failure: str = Field(description="Why the server stopped before the end.")


class TimesPart(DocumentPart):
    """How the times of the frames were found."""

    of: Literal["names", "numbers", "index", "table", "video", "camera", "arrival", "none"]
    text: str
    began: str | None = Field(description="When time_s was 0, UTC.")
    began_unix_s: float | None
    began_of: Literal["names", "table", "file", "clock"] | None = Field(
        description="file: the time of creation of a video, in whole seconds; some phones write its end."
    )
    camera_clock_s: float | None = Field(description="The camera's own clock when time_s was 0.")


class CameraPart(DocumentPart):
    """What a camera used, as its driver answered; null where it does not say."""

    camera_size: tuple[int, int] | None
    camera_fps: float | None
    camera_format: str | None
    exposure_ms: float | None
    gain: float | None
    white_balance_k: float | None
    focus: float | None
    automatic: tuple[str, ...] = Field(description="Settings that the camera chose itself during the run.")
    asked: dict[str, object] = Field(description="Settings that were asked for.")
    backend: str = Field(description="OpenCV's name of the driver's interface.")


class CameraFormatPart(DocumentPart):
    """One size of one pixel format of a camera."""

    format: str = Field(description="Four letters.")
    size_px: tuple[int, int] = Field(description="Width and height.")
    fps: tuple[float, ...] = Field(description="Rates, or the smallest and the largest.")


class CameraRangePart(DocumentPart):
    """The range of a setting of a camera."""

    name: Literal["exposure", "gain", "white balance", "focus"]
    least: float
    most: float
    step: float
    usual: float = Field(description="The driver's default.")
    unit: str = Field(description="ms or K; empty: the camera's own.")


class ListedCameraPart(DocumentPart):
    """A camera of this machine."""

    number: int = Field(description="As track takes it.")
    path: str
    name: str
    serial: str = Field(description="Empty where the camera states none.")
    by_id: str = Field(
        description="A file of the same name wherever the camera is plugged in; empty without one."
    )
    formats: tuple[CameraFormatPart, ...]
    ranges: tuple[CameraRangePart, ...]
    problem: str = Field(description="Why the camera cannot be asked.")


class ServeDocument(Document):
    """The server of ``serve``; printed when viewers can connect."""

    format: Literal["cmp-serve"] = "cmp-serve"
    version: Literal[1] = 1
    address: str = Field(description="Address of the server on this machine.")


class CamerasDocument(Document):
    """The cameras that ``cameras`` lists."""

    format: Literal["cmp-cameras"] = "cmp-cameras"
    version: Literal[1] = 1
    cameras: tuple[ListedCameraPart, ...]


class PressPart(DocumentPart):
    """The frame with the largest press."""

    frame: int
    force_n: tuple[float, float, float]
    force_sigma_n: tuple[float, float, float] = Field(description="Standard deviations.")
    regions: int


class ContactPart(DocumentPart):
    """The contacts of a run."""

    reasons: dict[str, int] = Field(description="Reasons of contacts -> number of frames.")
    largest: PressPart | None


class TrackDocument(Document):
    """The summary of ``track``; also the file FILE.summary.json."""

    format: Literal["cmp-tracking"] = "cmp-tracking"
    version: Literal[1] = 1
    source: str
    pattern: str
    digest: str = Field(description="Of the layout.")
    ended_early: str | None = Field(description="Why the run ended early.")
    frames: FramesPart
    reasons: dict[str, int] = Field(
        description="Why frames are not tracked, or tracked in part -> number of frames."
    )
    starts: dict[str, int] = Field(description="How the numbering was found -> number of frames.")
    marker_shares: SharesPart
    time_ms: dict[str, float] = Field(description="Percentiles of the time of a frame.")
    frames_per_s: float | None
    rest: RestPart | None
    quality: QualityPart | None = Field(description="Medians over the frames.")
    jitter_px: float | None = Field(
        description="Scatter of a marker at rest, per axis; null with too few resting frames."
    )
    jitter_pairs: int
    contact: ContactPart | None = Field(None, description="With --contact.")
    largest_displacement: LargestPart | None
    times: TimesPart
    notes: tuple[str, ...] = Field((), description="What a user should know about the source.")
    cameras: tuple[CameraPart, ...] = ()
    live: LivePart | None = Field(None, description="With --live.")
    written: tuple[str, ...] = Field((), description="Files; not in the summary's file.")


class ViewPart(DocumentPart):
    """One view of a rig."""

    name: str
    position_mm: tuple[float, float, float]
    rms_px: float = Field(description="RMS residual of the view's pose at rest.")


class PositionsPart(DocumentPart):
    """The surface to which the positions belong."""

    of: Literal["pattern"]
    depth_mm: float | None = Field(description="Depth of the pattern below the touched surface.")
    continued_to_surface: bool


class ReconstructDocument(Document):
    """The summary of ``reconstruct``; also the file FILE.summary.json."""

    format: Literal["cmp-reconstruction"] = "cmp-reconstruction"
    version: Literal[1] = 1
    source: str
    pattern: str
    digest: str = Field(description="Of the layout.")
    ended_early: str | None
    frames: FramesPart
    reasons: dict[str, int]
    marker_shares: SharesPart
    lost_markers: dict[str, int] = Field(description="Why markers have no position -> number of markers.")
    sigma_um: tuple[float, ...] | None = Field(description="Median standard deviations in x, y and z.")
    systematic_um: tuple[float, ...] | None = Field(
        None,
        description="Standard deviations of the largest displacement in x, y and z by [[deviation]] or "
        "[medium_deviation] of the rig; the same error in all frames.",
    )
    time_ms: dict[str, float]
    views: tuple[ViewPart, ...]
    model_px: float
    warnings: tuple[str, ...]
    positions: PositionsPart
    contact: ContactPart | None = Field(None, description="With --contact.")
    largest_displacement: LargestPart | None
    times: TimesPart
    notes: tuple[str, ...] = Field((), description="What a user should know about the source.")
    cameras: tuple[CameraPart, ...] = ()
    live: LivePart | None = Field(None, description="With --live.")
    written: tuple[str, ...] = Field((), description="Files; not in the summary's file.")


class RecoverDocument(Document):
    """What ``track --recover`` and ``reconstruct --recover`` completed."""

    format: Literal["cmp-recovery"] = "cmp-recovery"
    version: Literal[1] = 1
    written: str | None = Field(description="Null where no complete frame was found.")
    frames: int
    problems: tuple[str, ...]


class RenderDocument(Document):
    """What ``render`` drew."""

    format: Literal["cmp-rendering"] = "cmp-rendering"
    version: Literal[1] = 1
    written: tuple[str, ...]
    size_px: tuple[int, int] = Field(description="Width and height of the picture.")
    frames: int
    fps: float | None = Field(description="Frames per second of a sequence.")
    visible: tuple[int, ...] | None = Field(description="Visible markers, by view; null for a sequence.")

    @property
    def image(self) -> NDArray[Any]:
        """The picture, (H, W, 3) BGR, uint8 (uint16 for a 16-bit sensor); not of a sequence."""
        return self.found.image  # type: ignore[no-any-return]

    @property
    def truth(self) -> Any:
        """The picture's ``Truth``: the true places of the markers; not of a sequence."""
        return self.found.truth

    @property
    def warnings(self) -> tuple[str, ...]:
        """Doubtful parts."""
        return self.found.warnings  # type: ignore[no-any-return]

    def save(self, path: str | Path, truth: str | Path | None = None) -> None:
        """Write the picture, and the truth where a file is given; see ``Rendered.save``."""
        self.found.save(path, truth)

    def _repr_png_(self) -> bytes | None:
        """The picture, for notebooks."""
        return None if self.visible is None else self.found._repr_png_()


class ExportDocument(Document):
    """What ``export`` wrote."""

    format: Literal["cmp-export"] = "cmp-export"
    version: Literal[1] = 1
    kind: Literal["lerobot", "zarr"]
    written: str
    episodes: int
    frames: int
    fps: float | None = Field(description="Frames per second of a LeRobot data set.")


class EvaluateDocument(Document):
    """The files of ``evaluate``, and the document of report.json, whose figures differ by experiment."""

    format: Literal["cmp-evaluation-run"] = "cmp-evaluation-run"
    version: Literal[1] = 1
    written: tuple[str, ...]
    report: dict[str, object] = Field(description="As in report.json: format cmp-evaluation, version 1.")
