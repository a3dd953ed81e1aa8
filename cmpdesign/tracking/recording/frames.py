"""A frame for recordings and live viewers: time, markers as records, diagnostics, images."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import InputError
from cmpdesign.files.image_header import size_in_header
from cmpdesign.tracking.columns import AXES, COVARIANCE, FRAME_STATUS, Columns
from cmpdesign.tracking.force_table import torque_about_origin
from cmpdesign.tracking.recording.messages import ERROR, OK, WARN, Lens
from cmpdesign.tracking.recording.options import QUALITY
from cmpdesign.tracking.recording.points import M_PER_MM, Records, marker_records, region_records

NS_PER_S = 10**9
STEP_NS = NS_PER_S // 30  # time from the previous frame to a frame without a time of the source
_STATUS_NAMES = ("lost", "measured", "repaired", "fitted")

# (frame number, view) -> PNG, or None; the view is None for the image with all views.
ImagesOf = Callable[[int, int | None], bytes | None]


class CameraView(NamedTuple):
    """A view that an image shows: the first part of its topics, and its intrinsics."""

    base: str
    lens: Lens


class ImagePlace(NamedTuple):
    """The first part of an image's topics, without "/" before it, and the views that it shows."""

    base: str
    views: tuple[CameraView, ...]


@dataclass(frozen=True)
class FrameImage:
    """An image of a frame.

    Attributes:
        base: the first part of its topics, without "/" before it.
        png: the file's bytes.
        size_px: (width, height).
        views: cameras of the views that the image shows.
    """

    base: str
    png: bytes
    size_px: tuple[int, int]
    views: tuple[CameraView, ...]

    @property
    def frame_id(self) -> str:
        """The camera's coordinate frame."""
        return f"{self.base.replace('/', '_')}_camera"


@dataclass(frozen=True, eq=False)
class FrameContact:
    """The contact of a frame, in the markers' frame.

    Attributes:
        wrench: (6,) force in N and torque in N m about the origin; NaN where unknown.
        regions: (R,) records of ``REGION``.
    """

    wrench: NDArray[np.float64]
    regions: Records


@dataclass(frozen=True, eq=False)
class RecordedFrame:
    """A frame.

    Attributes:
        number: of the source.
        ns: its time, ns.
        markers: (M,) records, see ``marker_records``.
        level: OK, WARN or ERROR.
        text: the frame's status, its reason and the hints.
        values: values of the diagnostics; numbers as text, "nan" where unknown.
        images: the images that are recorded or shown.
        contact: the contact, if it is read.
    """

    number: int
    ns: int
    markers: Records
    level: int
    text: str
    values: dict[str, str]
    images: tuple[FrameImage, ...]
    contact: FrameContact | None = None


class FrameReader:
    """Makes frames from columns; the frames' times continue from chunk to chunk."""

    def __init__(self) -> None:
        self._last_ns = -STEP_NS

    def frames(self, columns: Columns, about: Columns, images_of: ImagesOf) -> Iterator[RecordedFrame]:
        """The frames of a chunk.

        Args:
            columns: the columns of frames of a ``RecordedTable``.
            about: its shared columns.
            images_of: gives the images.
        """
        records, contacts = marker_records(columns, about), _contacts(columns, about)
        views = [str(name) for name in about["view_names"]]
        began_ns = _began_ns(about)
        for place, number in enumerate(columns["frame"].tolist()):
            row = {name: values[place] for name, values in columns.items()}
            level, text = _judge(row)
            yield RecordedFrame(
                number,
                began_ns + self._time_ns(float(row["time_s"])),
                records[place],
                level,
                text,
                _diagnostic_values(row, records["status"][place], views),
                tuple(_frame_images(number, about, images_of)),
                contacts[place] if contacts else None,
            )

    def _time_ns(self, time_s: float) -> int:
        """A frame's time; for a frame without a time, a fixed time after the previous frame."""
        known = np.isfinite(time_s)
        self._last_ns = max(0, round(time_s * NS_PER_S)) if known else self._last_ns + STEP_NS
        return self._last_ns


def _contacts(columns: Columns, about: Columns) -> list[FrameContact]:
    """The contact of every frame; none without the columns of a contact."""
    if "force_n" not in columns:
        return []
    torque_nmm = torque_about_origin(columns["torque_nmm"], columns["force_n"], about)
    wrenches = np.concatenate([columns["force_n"], torque_nmm * M_PER_MM], axis=1)
    return [FrameContact(*each) for each in zip(wrenches, region_records(columns, about), strict=True)]


def _began_ns(about: Columns) -> int:
    """When the frames' times begin, ns since 1970; 0 where only the file's time of creation, or nothing, says it."""
    began_s = float(about.get("began_unix_s", np.nan))
    is_exact = str(about.get("began_of", "")) in ("names", "table", "clock")
    return round(began_s * NS_PER_S) if is_exact and np.isfinite(began_s) else 0


def image_places(about: Columns, is_one_a_view: bool) -> list[ImagePlace]:
    """The places of the images of all frames.

    Args:
        about: the shared columns of a ``RecordedTable``.
        is_one_a_view: the source has an image for each view; otherwise one image shows all views.
    """
    return [_place(view, about) for view in (range(len(about["view_names"])) if is_one_a_view else [None])]


def _place(view: int | None, about: Columns) -> ImagePlace:
    frame_id = str(about["frame_id"])
    base = frame_id if view is None else f"{frame_id}/{_topic_name(str(about['view_names'][view]))}"
    return ImagePlace(base, tuple(_views_in(view, base, about)))


def _frame_images(number: int, about: Columns, images_of: ImagesOf) -> Iterator[FrameImage]:
    for view in (None, *range(len(about["view_names"]))):
        png = images_of(number, view)
        if png is not None:
            place = _place(view, about)
            yield FrameImage(place.base, png, _size_px(png), place.views)


def _views_in(view: int | None, base: str, about: Columns) -> Iterator[CameraView]:
    """The views that an image shows: one view, or all views."""
    names = [str(name) for name in about["view_names"]]
    if not names:
        yield CameraView(base, Lens())
    for k in range(len(names)) if view is None else [view]:
        lens = Lens(*(about[f"view_{name}"][k].tolist() for name in Lens._fields))
        lens = lens._replace(distortion=[value for value in lens.distortion if np.isfinite(value)])
        is_one_of_many = view is None and len(names) > 1
        yield CameraView(f"{base}/{_topic_name(names[k])}" if is_one_of_many else base, lens)


def _size_px(png: bytes) -> tuple[int, int]:
    size = size_in_header(png)
    if size is None:
        raise InputError("a kept image has no size")
    return size[0], size[1]


def _topic_name(view: str) -> str:
    """A view's name as a part of a topic."""
    name = re.sub(r"\W", "_", view, flags=re.ASCII)
    return name if name[:1].isalpha() else f"view_{name}"


def _judge(row: dict[str, Any]) -> tuple[int, str]:
    """Level and text of a frame: an error where the frame is not tracked, a warning where a reason or a hint limits
    it.
    """
    status, reason, hints = FRAME_STATUS[row["frame_status"]], str(row["reason"]), str(row["hints"])
    notes = "; ".join(note for note in (reason, hints, _contact_note(row)) if note)
    level = ERROR if status != "tracked" else WARN if notes else OK
    return level, f"{status}: {notes}" if notes else status


def _contact_note(row: dict[str, Any]) -> str:
    """Why a tracked frame has no force, or why it is to be doubted; empty at rest."""
    from extractor.contact import ContactReason

    found = ContactReason(row.get("contact_reason", ContactReason.NONE))
    is_usual = found is ContactReason.NOTHING_TOUCHED or FRAME_STATUS[row["frame_status"]] != "tracked"
    return "" if is_usual else found.text


def _diagnostic_values(row: dict[str, Any], statuses: Any, views: list[str]) -> dict[str, str]:
    """The values of a frame in a DiagnosticStatus; numbers as text, "nan" where unknown."""
    counts = np.bincount(statuses, minlength=len(_STATUS_NAMES)).tolist()
    values = {
        "frame": str(row["frame"]),
        "frame_status": FRAME_STATUS[row["frame_status"]],
        "reason": str(row["reason"]),
        "elapsed_ms": f"{row['elapsed_ms']:.3f}",
    }
    if "start" in row:
        values["start"] = str(row["start"])
    values |= {f"markers_{name}": str(count) for name, count in zip(_STATUS_NAMES, counts, strict=True)}
    if "force_n" in row:
        values |= _contact_values(row)
    for name, numbers in zip(views or [""], row["quality"], strict=True):
        before = f"{name}." if len(views) > 1 else ""
        values |= {f"{before}{key}": f"{v:.6g}" for key, v in zip(QUALITY, numbers.tolist(), strict=True)}
    return values


def _contact_values(row: dict[str, Any]) -> dict[str, str]:
    """Reason, number of regions, and the standard deviations of force (N) and torque (N m)."""
    from extractor.contact import ContactReason

    diagonal = [COVARIANCE.index(name) for name in ("xx", "yy", "zz")]
    sigma_n, sigma_nmm = (np.sqrt(row[name][diagonal]) for name in ("force_cov_n2", "torque_cov_nmm2"))
    values = {
        "contact_reason": ContactReason(row["contact_reason"]).name.lower(),
        "contact_regions": str(row["contact_regions"]),
        "utilisation": f"{row['utilisation']:.6g}",
    }
    values |= {f"force_sigma_{axis}": f"{value:.6g}" for axis, value in zip(AXES, sigma_n, strict=True)}
    torques = zip(AXES, sigma_nmm * M_PER_MM, strict=True)
    return values | {f"torque_sigma_{axis}": f"{value:.6g}" for axis, value in torques}
