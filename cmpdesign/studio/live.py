"""The live part: the latest frame of a run of ``track`` or ``reconstruct``, and frames of the browser's camera."""

from __future__ import annotations

import json
import tempfile
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from threading import Condition, Thread
from typing import TYPE_CHECKING, Any

import numpy as np

from cmpdesign.errors import CmpDesignError
from cmpdesign.files.images import decode_bytes, to_jpeg
from cmpdesign.patterns.colors import COLORS
from cmpdesign.studio.readings import in_8_bits
from cmpdesign.studio.recording import Recorder, Recordings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from cmpdesign.tracking.live.view import LiveCount
    from cmpdesign.tracking.run import TrackingRun
    from extractor import Reference
    from extractor.contact import ContactForce

MAX_CAMERA_PIXELS = 8_000_000  # of a frame of the browser's camera
JPEG_QUALITY = 80  # of a shown frame; the reader gets the frame itself
WAIT_S = 1.0  # for a new frame, before the connection is looked at again
_RATE_FRAMES = 30  # over which the rate is counted


@dataclass(frozen=True, eq=False)
class Latest:
    """The latest frame: its count, the tracked frame, its image, the frames per second, and when it was read."""

    count: int
    frame: Any
    image: Any
    frames_per_s: float
    read_s: float

    def message(self) -> bytes:
        """The message for the page, now; a surface is shown without its images."""
        age_ms = self.frame.elapsed_ms + 1e3 * (time.monotonic() - self.read_s)
        image = b"" if hasattr(self.frame, "shape") else shown_image(self.image)
        return frame_message(self.frame, self.frames_per_s, age_ms, image)


@dataclass(eq=False)
class LiveFeed:
    """Keeps the latest frame of a run for the page; stands in the place of a ``LiveView``.

    The run goes at the rate of its source, whatever the page does: the page asks for the latest frame, and frames in
    between are not shown. A recorded source is paced by its times.

    Attributes:
        name: the source's name.
        layout: the pad.
        is_paced: the source is no camera.
        recorder: records for the page; None: the run is in space, where only the command line records.
        failure: why the run ended early; "" else.
        is_over: the run has ended.
    """

    name: str
    layout: Reference
    is_paced: bool
    recorder: Recorder | None = None
    failure: str = ""
    is_over: bool = False
    address: str = ""
    wait_s: float = 0.0
    run: TrackingRun | None = None
    _changed: Condition = field(default_factory=Condition, repr=False)
    _times: deque[float] = field(default_factory=lambda: deque(maxlen=_RATE_FRAMES), repr=False)
    _latest: Latest | None = None
    _began_s: float = float("nan")

    def add(self, frame: Any, image: Any = None) -> None:
        """Take a frame of the run."""
        if self.is_paced and np.isfinite(frame.time_s):
            now_s = time.monotonic()
            self._began_s = self._began_s if np.isfinite(self._began_s) else now_s - frame.time_s
            time.sleep(min(max(0.0, self._began_s + frame.time_s - now_s), 1.0))
        if self.recorder is not None:
            self.recorder.add(frame)
        with self._changed:
            self._times.append(time.monotonic())
            count = 0 if self._latest is None else self._latest.count + 1
            self._latest = Latest(count, frame, image, rate_of(self._times), self._times[-1])
            self._changed.notify_all()

    def newer(self, count: int) -> Latest | None:
        """The latest frame, if it is newer than a count; else the next one, waited for; None after ``WAIT_S``."""
        with self._changed:
            self._changed.wait_for(lambda: self._latest is not None and self._latest.count > count, WAIT_S)
            return self._latest if self._latest is not None and self._latest.count > count else None

    def reset_rest(self) -> None:
        """The next frame of one view is the rest frame; a surface keeps its own."""
        if self.run is not None and hasattr(self.run.tracker, "rest"):
            self.run.tracker.rest = None

    def wait(self, seconds: float) -> bool:
        """No wait: a page that opens later sees the latest frame."""
        return True

    def waiting(self) -> int:
        """No frame waits."""
        return 0

    def count(self) -> LiveCount:
        """The counts so far."""
        from cmpdesign.tracking.live.view import LiveCount

        shown = 0 if self._latest is None else self._latest.count + 1
        return LiveCount(shown, 0, False, self.failure)

    def stop(self) -> None:
        """End the run after its present frame, and forget a recording that was not saved."""
        if self.run is not None:
            self.run.stop.is_requested = True
        if self.recorder is not None:
            self.recorder.close()

    def close(self) -> LiveCount:
        """The run has ended; the last frame stays."""
        self.is_over = True
        return self.count()

    def follow(self, run: TrackingRun) -> Thread:
        """Start the run in a thread; a failure is told to the page."""
        from cmpdesign.tracking.table import TrackTable
        from extractor import Tracker

        self.run, run.live = run, self  # type: ignore[assignment]
        if isinstance(run.tracker, Tracker):
            self.recorder = Recorder(lambda: TrackTable(run.tracker, lambda: run.source.times))

        def go() -> None:
            try:
                run.go(lambda frame: None)
                self.failure = run.ended_early
            except Exception as error:  # of a camera's driver, too
                self.failure = " ".join(str(error).split()) or type(error).__name__
            self.is_over = True

        thread = Thread(target=go, name="live", daemon=True)
        thread.start()
        return thread


class NoSink:
    """The sink of a run that is not recorded."""

    def add(self, frame: Any, image: Any = None) -> None:
        """Forget the frame."""

    def close(self) -> None:
        """There is no file."""

    def kept(self) -> str:
        """There is no file."""
        return ""


class CameraReader:
    """Reads the frames that the browser's camera sends, one after the other."""

    def __init__(self, layout: Reference) -> None:
        from cmpdesign.tracking.table import TrackTable
        from extractor import Tracker

        self._tracker = Tracker(layout, side="either")
        self.recorder: Recorder | None = Recorder(lambda: TrackTable(self._tracker))
        self._times: deque[float] = deque(maxlen=_RATE_FRAMES)

    def reset_rest(self) -> None:
        """The next frame is the rest frame."""
        self._tracker.rest = None

    def close(self) -> None:
        """Forget a recording that was not saved."""
        if self.recorder is not None:
            self.recorder.close()

    def read(self, data: bytes) -> bytes:
        """The message of one frame; a frame that cannot be decoded has a reason.

        Args:
            data: bytes of an image file.
        """
        now_s, image, problem = time.monotonic(), None, ""
        try:
            image = decode_bytes(data, "the frame", MAX_CAMERA_PIXELS)
        except CmpDesignError as error:
            problem = str(error)
        self._times.append(now_s)
        tracked = self._tracker.track(image, time_s=now_s, reason=problem)
        if self.recorder is not None:
            self.recorder.add(tracked)
        return frame_message(tracked, rate_of(self._times))


def open_camera(layout: Reference, number: int) -> LiveFeed:
    """Track a camera of this machine, until the feed is stopped.

    Raises:
        CmpDesignError: the camera cannot be opened.
    """
    from cmpdesign.api.sequences import track_job

    with tempfile.TemporaryDirectory(prefix="cmpdesign-studio-") as folder:
        run = track_job(layout, number, Path(folder) / "run.npz", side="either").prepare()
        run.sink.close()
    run.sink = NoSink()
    feed = LiveFeed(run.source.name, layout, is_paced=not run.source.is_live)
    feed.follow(run)
    return feed


def obey(source: LiveFeed | CameraReader, words: str, recordings: Recordings) -> dict[str, Any] | None:
    """Do what the page says of a source: "rest", "record KIND" or "save"; the answer, if there is one."""
    recorder = source.recorder
    try:
        if words == "rest":
            source.reset_rest()
        elif recorder is None:
            raise CmpDesignError("this source is recorded by the command line: cmpdesign view ... -o run.npz")
        elif words == "save":
            return recorder.save(recordings)
        elif words.startswith("record "):
            recorder.start(words.removeprefix("record "))
            return {"recording": True}
    except CmpDesignError as error:
        return {"note": str(error)}
    return None


def hello_document(layout: Reference, name: str) -> dict[str, Any]:
    """What the page needs before the first frame: the pad's cells, their colors, and the markers at rest."""
    return {
        "name": name,
        "markers": int(layout.present.sum()),
        "cells": layout.cell_corners.tolist(),
        "colors": [layout.palette[COLORS[color]] for color in layout.cell_color.tolist()],
        "xy_mm": layout.xy_mm.round(4).tolist(),
    }


def frame_message(frame: Any, frames_per_s: float, age_ms: float = 0.0, image: bytes = b"") -> bytes:
    """A tracked frame or a surface for the page: markers that are found, with their displacements.

    Args:
        frame: a ``Tracked`` or a ``ShapeFrame``.
        frames_per_s: rate of the reader.
        age_ms: since the image was there.
        image: a file that the page shows below the markers.
    """
    in_space = hasattr(frame, "shape")
    status = frame.shape.status if in_space else frame.markers.status
    place = frame.shape.xyz_mm if in_space else frame.markers.xy_px
    moved = frame.shape.displacement_mm if in_space else frame.displacement_px
    found = np.flatnonzero(np.isfinite(place).all(axis=1))
    quality = None if in_space else frame.markers.quality
    largest_mm = np.linalg.norm(frame.shape.displacement_mm if in_space else frame.displacement_mm, axis=1)
    contact = frame.contact if in_space else None
    columns = {
        "ids": found,
        "status": status[found],
        "place": place[found],
        "moved": np.nan_to_num(moved[found]),
    }
    if contact is not None and np.isfinite(contact.force_n).all():
        traction = np.nan_to_num(contact.marker_traction_mpa[found])
        columns |= {"shear_mpa": traction[:, :2], "pressure_mpa": -traction[:, 2]}
    told = {
        "index": frame.index,
        "tracked": frame.status == 1,
        "reason": frame.reason if not in_space or not frame.shape.problem else frame.shape.problem,
        "hints": [] if quality is None else list(quality.hints),
        "elapsed_ms": round(frame.elapsed_ms, 2),
        "age_ms": round(age_ms, 2),
        "frames_per_s": round(frames_per_s, 2),
        "measured": int(np.count_nonzero(status == 1)),
        "in_space": in_space,
        "largest_mm": round(float(np.nanmax(largest_mm)), 4) if np.isfinite(largest_mm).any() else None,
        "contact": None if contact is None else contact_document(contact),
    }
    return packed(told, columns, image)


def packed(told: dict[str, Any], columns: Mapping[str, NDArray[Any]], rest: bytes = b"") -> bytes:
    """A message: the length of its document as 4 bytes, the document, columns of 4-byte floats, and other bytes.

    The document names the columns and the count of numbers of each; the first byte is the lowest everywhere.
    """
    text = json.dumps({**told, "columns": {name: column.size for name, column in columns.items()}}).encode()
    text += b" " * (-len(text) % 4)  # floats start at a multiple of 4
    numbers = [np.ascontiguousarray(column, "<f4").tobytes() for column in columns.values()]
    return b"".join([len(text).to_bytes(4, "little"), text, *numbers, rest])


def contact_document(contact: ContactForce) -> dict[str, Any]:
    """Force and torque with their deviations, the largest pressure and shear, the regions' centres."""
    known = bool(np.isfinite(contact.force_n).all())
    values: dict[str, Any] = {"reason": contact.reason.text, "known": known}
    if known:
        sigma = {"force_sigma_n": contact.force_cov_n2, "torque_sigma_nmm": contact.torque_cov_nmm2}
        values |= {
            name: np.nan_to_num(np.sqrt(np.diag(cov))).round(4).tolist() for name, cov in sigma.items()
        }
        traction = np.nan_to_num(contact.marker_traction_mpa)
        values |= {
            "force_n": contact.force_n.round(4).tolist(),
            "torque_nmm": contact.torque_nmm.round(3).tolist(),
            "max_pressure_mpa": round(float(-traction[:, 2].min()), 5),
            "max_shear_mpa": round(float(np.hypot(*traction[:, :2].T).max()), 5),
            "utilisation": round(contact.utilisation, 3) if np.isfinite(contact.utilisation) else None,
            "regions": [region.centre_mm.round(3).tolist() for region in contact.regions],
        }
    return values


def shown_image(pixels: Any) -> bytes:
    """A frame's image as a JPEG; empty without an image."""
    if pixels is None:
        return b""
    color = pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=2)
    return to_jpeg(in_8_bits(np.ascontiguousarray(color[..., :3])), JPEG_QUALITY)


def rate_of(times_s: deque[float]) -> float:
    """Frames per second of the last frames; 0 before the second."""
    span_s = times_s[-1] - times_s[0] if len(times_s) > 1 else 0.0
    return (len(times_s) - 1) / span_s if span_s > 0 else 0.0
