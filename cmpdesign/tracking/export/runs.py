"""Runs read back from the .npz files of ``track`` and ``reconstruct``: one file is one episode."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import CmpDesignError, parameter
from cmpdesign.files.npz import NpzError, read_npz
from cmpdesign.tracking.columns import Columns
from cmpdesign.tracking.force_table import FORCE_COLUMNS
from cmpdesign.tracking.recording.points import positions_mm

_SHARED = ("frame", "time_s", "frame_status", "status", "layer")
# Format of a file -> the columns that are read.
_COLUMNS = {
    "cmp-tracking": (*_SHARED, "xy_px", "displacement_mm", "layout_from_image", "mm_per_px"),
    "cmp-reconstruction": (*_SHARED, "3D_Positions", "3D_Displacements"),
}
# What a run has with an option -> the columns of this option.
_OPTIONAL = {"surface": ("surface_displacement_mm",), "contact": FORCE_COLUMNS}
MAX_FPS = 1e5
WHOLE_FPS = 0.005  # a rate within this distance of a whole number is rounded


@dataclass(frozen=True, eq=False)
class Run:
    """The frames of one run: F frames of M markers, k coordinates (2 of ``track``, 3 of ``reconstruct``).

    Attributes:
        path: the file.
        frame: (F,) int64, places in the source.
        arrays: name -> values: displacement_mm and position_mm (F, M, k) float32, NaN where lost; status (F, M) uint8;
            frame_status (F,) uint8; time_s (F,) float64; with ``surface`` surface_displacement_mm (F, M, 3) float32;
            with ``contact`` the ``FORCE_COLUMNS``.
    """

    path: Path
    frame: NDArray[np.int64]
    arrays: dict[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.frame)

    def __repr__(self) -> str:
        columns = ", ".join(f"{name} {values.shape}" for name, values in self.arrays.items())
        return f"<Run {self.path.name}: {len(self)} frames; {columns}>"


@dataclass(frozen=True)
class RunKind:
    """The common properties of the runs of one data set.

    Attributes:
        format: of the files, for example "cmp-reconstruction".
        digest: of the layout.
        surface, contact: "with" or "without" the touched surface, or forces.
    """

    format: str
    digest: str
    surface: str
    contact: str


def load_run(path: str | Path) -> Run:
    """Read an .npz file of ``track`` or ``reconstruct``.

    Raises:
        CmpDesignError: the file cannot be read, is no file of these commands, or holds no frame.
    """
    path = Path(path)
    kind = _kind_of(path)
    columns = _read_columns(path, *_COLUMNS[kind.format])
    if len(columns["frame"]) == 0:
        raise CmpDesignError(f"{path}: holds no frame")
    arrays = _arrays_of(columns, kind)
    for option, names in _OPTIONAL.items():
        if getattr(kind, option) == "with":
            further = _read_columns(path, *names)
            arrays |= {
                name: values.astype(np.float32 if values.dtype.kind == "f" else values.dtype)
                for name, values in further.items()
            }
    return Run(path, columns["frame"], arrays)


def require_one_kind(paths: Sequence[Path]) -> RunKind:
    """Check that runs can be in one data set: of one layout, and of one command and its options.

    Raises:
        CmpDesignError: see ``load_run``; or two runs differ.
    """
    kinds = [_kind_of(path) for path in paths]
    for path, kind in zip(paths[1:], kinds[1:], strict=True):
        for what in ("format", "digest", *_OPTIONAL):
            one, other = getattr(kinds[0], what), getattr(kind, what)
            if one != other:
                raise CmpDesignError(
                    f"{path}: the {what} is {other}, that of {paths[0]} is {one}; export them as two data sets"
                )
    return kinds[0]


def frames_per_second(runs: Sequence[Path]) -> float:
    """The frame rate of runs: 1 over the median time between frames.

    Raises:
        CmpDesignError: no two frames of a run have times.
    """
    steps_s = []
    for path in runs:
        columns = _read_columns(path, "time_s", "frame")
        step_s = np.diff(columns["time_s"]) / np.diff(columns["frame"])
        steps_s.append(step_s[np.isfinite(step_s) & (step_s > 1 / MAX_FPS)])
    every = np.concatenate(steps_s)
    if not len(every):
        raise CmpDesignError(f"{runs[0]}: no two frames have times; give {parameter('fps')}")
    return tidy_fps(1 / float(np.median(every)))


def tidy_fps(fps: float) -> float:
    """A whole number where the rate is whole within rounding, else three decimals."""
    whole = round(fps)
    return whole if whole and abs(fps - whole) < WHOLE_FPS * whole else round(fps, 3)


def uneven_times(runs: Sequence[Path], fps: float) -> tuple[str, ...]:
    """A sentence on each run whose times differ by more than half a frame from an even rate."""
    found = []
    for path in runs:
        times_s = load_run(path).arrays["time_s"]
        late_s = times_s - times_s[0] - np.arange(len(times_s)) / fps
        shift_s = float(np.nanmax(np.abs(late_s), initial=0.0))
        if shift_s > 0.5 / fps:
            found.append(
                f"{path}: the times differ by up to {shift_s:.3g} s from {fps:g} frames per second; "
                "observation.tactile.time_s holds the times of the run"
            )
    return tuple(found)


def _kind_of(path: Path) -> RunKind:
    if path.suffix != ".npz":
        raise CmpDesignError(f"{path}: unknown ending; expected .npz, as written by track and reconstruct")
    try:
        columns = read_npz(path, "format", "digest")
    except NpzError:
        columns = {}
    if str(columns.get("format")) not in _COLUMNS:
        raise CmpDesignError(f"{path} is no run; expected an .npz file of track or reconstruct")
    return RunKind(
        str(columns["format"]),
        str(columns["digest"]),
        **{option: _with_or_without(path, names[0]) for option, names in _OPTIONAL.items()},
    )


def _with_or_without(path: Path, column: str) -> str:
    try:
        read_npz(path, column)
    except NpzError:
        return "without"
    return "with"


def _read_columns(path: Path, *names: str) -> Columns:
    try:
        return read_npz(path, *names)
    except NpzError as error:
        raise CmpDesignError(f"{path}: cannot be read ({error})") from None


def _arrays_of(columns: Columns, kind: RunKind) -> dict[str, NDArray[Any]]:
    """The arrays of the markers, without the virtual markers."""
    markers = len(columns["layer"])
    if kind.format == "cmp-reconstruction":
        moved, places = columns["3D_Displacements"][:, :markers], columns["3D_Positions"][:, :markers]
    else:
        moved, places = columns["displacement_mm"], positions_mm(columns["xy_px"], columns)
    return {
        "displacement_mm": moved.astype(np.float32),
        "position_mm": places.astype(np.float32),
        "status": columns["status"][:, :markers].astype(np.uint8),
        "frame_status": columns["frame_status"].astype(np.uint8),
        "time_s": columns["time_s"].astype(np.float64),
    }
