"""Frames as rows of Rerun: the content of a recording's messages, as columns of Rerun's entities."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cmpdesign.libraries import extra
from cmpdesign.tracking.recording.frames import CameraView, FrameContact, FrameImage, RecordedFrame
from cmpdesign.tracking.recording.messages import ERROR, OK, WARN
from cmpdesign.tracking.recording.points import Records

APPLICATION = "cmpdesign"
DIAGNOSTICS_ENTITY = "/diagnostics"
# Components of the markers, by the fields of their records; a field of several numbers is a component of its own name.
_VECTORS: Mapping[str, tuple[str, ...]] = {
    "displacement": ("dx", "dy", "dz"),
    "normal": ("nx", "ny", "nz"),
    "surface_displacement": ("surface_dx", "surface_dy", "surface_dz"),
    "xy_px": ("x_px", "y_px"),
    "displacement_px": ("dx_px", "dy_px"),
    "traction": ("traction_x", "traction_y", "traction_z"),
}
_POSITION = ("x", "y", "z")
_LEVELS = {OK: "INFO", WARN: "WARN", ERROR: "ERROR"}
# RGBA of the points, by status: lost, measured, repaired, fitted.
_COLORS = np.array([0x808080FF, 0x2CA02CFF, 0xFF9F1CFF, 0xD62728FF], np.uint32)


def require_rerun() -> Any:
    """The module rerun.

    Raises:
        MissingLibraryError: it is not installed.
    """
    os.environ.setdefault(
        "RUST_LOG", "off"
    )  # failures are raised here; the library's own lines would appear in the output
    with extra("rerun", "write .mcap"):
        import rerun
    return rerun


class EntityRows(NamedTuple):
    """Rows of an entity, as ``Chunk.from_columns`` and ``RecordingStream.send_columns`` take them."""

    entity: str
    timelines: list[Any]
    columns: list[Any]


class RerunRows:
    """Makes rows of frames.

    Args:
        frame_id: the coordinate frame of the markers, and the first part of all entities but the diagnostics'.
    """

    def __init__(self, frame_id: str) -> None:
        self._rerun, self._base = require_rerun(), f"/{frame_id}"

    def of(self, frames: Sequence[RecordedFrame]) -> Iterator[EntityRows]:
        """The rows of F frames, at least one, of one table: F rows an entity."""
        records = np.stack([frame.markers for frame in frames])
        yield self._rows(f"{self._base}/markers", frames, self._markers(records))
        yield self._rows(f"{self._base}/displacement", frames, self._arrows(records))
        yield self._rows(DIAGNOSTICS_ENTITY, frames, self._diagnostics(frames))
        contacts = [frame.contact for frame in frames if frame.contact is not None]
        if contacts:
            yield from self._contacts(frames, contacts)
        yield from self._images(frames)

    def _rows(self, entity: str, frames: Sequence[RecordedFrame], columns: Iterable[Any]) -> EntityRows:
        """One row per frame, on two timelines: the frames' numbers, and the source's times."""
        column = self._rerun.TimeColumn
        numbers = np.array([frame.number for frame in frames], np.int64)
        times = np.array([frame.ns for frame in frames], "timedelta64[ns]")
        timelines = [column("frame", sequence=numbers), column("time", duration=times)]
        return EntityRows(entity, timelines, list(columns))

    def _markers(self, records: Records) -> list[Any]:
        """The (F, M) markers: points in metres, colored by status, and all other fields as they are recorded."""
        names = records.dtype.names or ()
        vectors = {name: fields for name, fields in _VECTORS.items() if fields[0] in names}
        single = {field for fields in (*vectors.values(), _POSITION) for field in fields}
        columns: dict[str, Any] = {
            name: _fixed_lists(_joined(records, fields)) for name, fields in vectors.items()
        }
        for name in names:
            if name not in single:
                values = records[name].reshape(records.size, -1)
                columns[name] = _fixed_lists(values) if records.dtype[name].shape else values[:, 0]
        points = self._rerun.Points3D.columns(
            positions=_joined(records, _POSITION),
            colors=_COLORS[records["status"].ravel().clip(max=len(_COLORS) - 1)],
        )
        lengths = [records.shape[1]] * len(records)
        return [*points.partition(lengths), *self._own("Markers", columns).partition(lengths)]

    def _arrows(self, records: Records) -> Any:
        """Displacements as arrows that end at the markers, of markers with a displacement."""
        ends = _joined(records, _POSITION).reshape(*records.shape, 3)
        moved = _joined(records, _VECTORS["displacement"]).reshape(ends.shape)
        known = np.isfinite(ends).all(axis=2) & np.isfinite(moved).all(axis=2)
        arrows = self._rerun.Arrows3D.columns(origins=(ends - moved)[known], vectors=moved[known])
        return arrows.partition(known.sum(axis=1))

    def _diagnostics(self, frames: Sequence[RecordedFrame]) -> list[Any]:
        log = self._rerun.TextLog.columns(
            text=[frame.text for frame in frames], level=[_LEVELS[frame.level] for frame in frames]
        )
        values = {name: [frame.values[name] for frame in frames] for name in frames[0].values}
        return [*log, *self._own("Diagnostics", values)]

    def _contacts(
        self, frames: Sequence[RecordedFrame], contacts: Sequence[FrameContact]
    ) -> Iterator[EntityRows]:
        """Force and torque, which viewers plot over time, and the regions: a point and its values."""
        wrenches = np.stack([contact.wrench for contact in contacts])
        for name, values in (("force", wrenches[:, :3]), ("torque", wrenches[:, 3:])):
            scalars = self._rerun.Scalars.columns(scalars=values.ravel()).partition([3] * len(values))
            yield self._rows(f"{self._base}/{name}", frames, scalars)
        records = np.concatenate([contact.regions for contact in contacts])
        own = {
            "area": records["area"],
            "force": _fixed_lists(_joined(records, ("force_x", "force_y", "force_z"))),
            "torque": _fixed_lists(_joined(records, ("torque_x", "torque_y", "torque_z"))),
        } | {
            name: _fixed_lists(records[name])
            for name in ("centre_covariance", "force_covariance", "torque_covariance")
        }
        points = self._rerun.Points3D.columns(positions=_joined(records, _POSITION))
        counts = [len(contact.regions) for contact in contacts]
        columns = [*points.partition(counts), *self._own("Regions", own).partition(counts)]
        yield self._rows(f"{self._base}/regions", frames, columns)

    def _images(self, frames: Iterable[RecordedFrame]) -> Iterator[EntityRows]:
        """Each image and its cameras; an entity has the frames with this image."""
        images: dict[str, list[tuple[RecordedFrame, FrameImage]]] = {}
        cameras: dict[str, list[tuple[RecordedFrame, FrameImage, CameraView]]] = {}
        for frame in frames:
            for image in frame.images:
                images.setdefault(image.base, []).append((frame, image))
                for view in image.views:
                    cameras.setdefault(view.base, []).append((frame, image, view))
        for base, rows in images.items():
            columns = self._rerun.EncodedImage.columns(
                blob=[image.png for _, image in rows], media_type=["image/png"] * len(rows)
            )
            yield self._rows(f"/{base}/image_raw", [frame for frame, _ in rows], columns)
        for base, seen in cameras.items():
            columns = self._cameras([image for _, image, _ in seen], [view for _, _, view in seen])
            yield self._rows(f"/{base}/camera_info", [frame for frame, _, _ in seen], columns)

    def _cameras(self, images: Sequence[FrameImage], views: Sequence[CameraView]) -> Any:
        """Sizes and intrinsics; a focal length of 0 stands for unknown intrinsics."""
        lenses = [view.lens for view in views]
        lists = {
            "size_px": [image.size_px for image in images],
            "focal_px": [lens.focal_px for lens in lenses],
            "centre_px": [lens.centre_px for lens in lenses],
            "distortion": [tuple(lens.distortion) or (0.0,) * 5 for lens in lenses],
            "area_px": [lens.area_px for lens in lenses],
        }
        return self._own("CameraInfo", {name: _fixed_lists(np.array(rows)) for name, rows in lists.items()})

    def _own(self, name: str, components: Mapping[str, Any]) -> Any:
        """Columns that Rerun has no type for."""
        return self._rerun.DynamicArchetype.columns(
            archetype=f"{APPLICATION}.{name}", components=dict(components)
        )


def _joined(records: Records, fields: tuple[str, ...]) -> NDArray[np.float32]:
    """(N, K) of K fields of N records in any shape."""
    return np.stack([records[field].ravel() for field in fields], axis=1)


def _fixed_lists(values: NDArray[Any]) -> Any:
    """(N, K) as N lists of K numbers."""
    with extra("rerun"):
        import pyarrow

    return pyarrow.FixedSizeListArray.from_arrays(
        pyarrow.array(np.ascontiguousarray(values).ravel()), values.shape[1]
    )
