"""What every source of frames gives: frames, and how their times were found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Protocol

from cmpdesign.errors import SourceError, parameter
from cmpdesign.files.images import FEWEST_BITS
from cmpdesign.inputs.cameras import CameraSettings, CameraState
from cmpdesign.inputs.files import MAX_PIXELS


@dataclass(frozen=True)
class Reading:
    """How a source is read.

    Attributes:
        fps: frames per second of pictures (None: 30), or instead of a video's own rate.
        max_pixels: limit of width x height of an image or of a frame.
        times: "names", "index", or a file of times; None: what the source says.
        bits: bits of a camera's values in pictures of 16 bits; None: found from the values.
        camera: settings that are asked of a camera.

    Raises:
        SourceError: a number of bits that no picture has.
    """

    fps: float | None = None
    max_pixels: int = MAX_PIXELS
    times: str | None = None
    bits: int | None = None
    camera: CameraSettings = field(default_factory=CameraSettings)

    def __post_init__(self) -> None:
        if self.bits is not None and not FEWEST_BITS <= self.bits <= 16:
            raise SourceError(f"{parameter('bits')} is {self.bits}; expected {FEWEST_BITS} to 16")


@dataclass(frozen=True, eq=False)
class SourceFrame:
    """A frame of a source.

    Attributes:
        time_s: time from the start of the source; NaN where unknown.
        image: (H, W, 3) BGR, as the sensor took it; None without an image; of several views a list of these.
        problem: reason for a missing image, or "".
        path: the image's own file; None for a frame of a video, a camera or a stream, and for several views.
    """

    time_s: float
    image: Any
    problem: str = ""
    path: Path | None = None

    def __repr__(self) -> str:
        seen = self.problem or (
            "x".join(map(str, self.image.shape)) if hasattr(self.image, "shape") else "views"
        )
        return f"<SourceFrame at {self.time_s:.6g} s: {seen}>"


@dataclass(frozen=True)
class SourceTimes:
    """How the times of a source were found.

    Attributes:
        of: "names", "numbers" (in names), "index", "table", "video", "camera", "arrival" or "none".
        text: the same for people, in one line.
        began_unix_s: when ``time_s`` was 0, s since 1970, UTC; None where unknown.
        began_of: where that is from: "names", "table", "file" (its time of creation) or "clock" (of this computer).
        camera_clock_s: the camera's own clock when ``time_s`` was 0; None without stamps of a camera.
        origin: name and time in s of the clock on which ``time_s`` counts, to join several sources; None: its own.
        is_doubtful: there are no times, or none that the source stands for.
    """

    of: str
    text: str
    began_unix_s: float | None = None
    began_of: str | None = None
    camera_clock_s: float | None = None
    origin: tuple[str, float] | None = None
    is_doubtful: bool = False

    def to_json(self) -> dict[str, Any]:
        """For the summary of a run."""
        began = (
            None if self.began_unix_s is None else datetime.fromtimestamp(self.began_unix_s, UTC).isoformat()
        )
        return {
            "of": self.of,
            "text": self.text,
            "began": began,
            "began_unix_s": self.began_unix_s,
            "began_of": self.began_of,
            "camera_clock_s": self.camera_clock_s,
        }


class FrameSource(Protocol):
    """A sequence of frames that is read once.

    Attributes:
        name: name for messages.
        total: number of frames that the source declares; None if unknown.
        fps: frames per second; None if unknown.
        ended_early: after the last frame, the reason for an early end; "" if all frames were read.
        is_live: the frames are read while they are taken: no number is declared, and only a stop ends the source.
        times: how times are found; for a live source final after the last frame.
        notes: what a user should know, one sentence each; more may come with the frames.
        camera: what each camera uses, as its driver answers; none of other sources.
    """

    name: str
    total: int | None
    fps: float | None
    ended_early: str
    is_live: bool

    @property
    def times(self) -> SourceTimes: ...

    @property
    def notes(self) -> list[str]: ...

    @property
    def camera(self) -> tuple[CameraState, ...]: ...

    def frames(self) -> Iterator[SourceFrame]: ...
