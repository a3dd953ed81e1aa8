"""The ground truth of an image, and its file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import InputError, OutputError
from cmpdesign.files.atomic import staged_file
from cmpdesign.files.npz import NpzError, read_npz
from cmpdesign.inputs.files import MAX_DATA_BYTES
from cmpdesign.scene.errors import SceneError


@dataclass(frozen=True, eq=False)
class Truth:
    """The exact ground truth of an image. The fields are named as in the .npz file.

    Where the scene's camera is a tuple of V views, the fields marked * have a leading axis of V.

    Attributes:
        marker_xy_px*: (M, 2) float64, image frame ((0, 0) is the centre of the top-left pixel).
        visible*: (M,) bool: inside the image, touching at least one undamaged colored or white cell, and not
            under dirt or glare.
        virtual_xy_px*: (E, m, 2) float64, on the true, curved gridlines; from the smaller marker id.
        cell_visible*: (C,) bool: all corners inside the image and the cell undamaged: not missing, and less
            than half of it under dirt or glare.
        mirrored*: the camera sees the pattern's back.
        H*: (3, 3) float64 image-from-layout; None when a surface is not flat or a lens distorts.
        marker_xyz_mm: (M, 3) float64, the surface in the layout frame; z is 0 on a flat surface.
        virtual_xyz_mm: (E, m, 3) float64.
    """

    marker_xy_px: NDArray[np.float64]
    visible: NDArray[np.bool_]
    virtual_xy_px: NDArray[np.float64]
    cell_visible: NDArray[np.bool_]
    mirrored: bool | NDArray[np.bool_]
    H: NDArray[np.float64] | None
    marker_xyz_mm: NDArray[np.float64]
    virtual_xyz_mm: NDArray[np.float64]

    def __repr__(self) -> str:
        return f"<Truth: {np.count_nonzero(self.visible)} of {self.visible.size} markers visible>"


def save_truth(truth: Truth, path: str | Path) -> Path:
    """Write the truth of one image as .npz, without ``H`` where it is None.

    Raises:
        OutputError: the file cannot be written; an existing file is unchanged.
    """
    return _save_npz(_truth_columns(truth), path)


def save_truths(truths: Sequence[Truth], time_s: Sequence[float], path: str | Path) -> Path:
    """Write a sequence as one .npz: every field with a leading axis of F frames, and ``time_s`` (F,).

    Raises:
        OutputError: the file cannot be written; an existing file is unchanged.
    """
    columns = {"time_s": np.asarray(time_s, dtype=np.float64)}
    for item in fields(Truth):
        values = [getattr(truth, item.name) for truth in truths]
        if all(value is not None for value in values):
            columns[item.name] = np.stack(values)
    return _save_npz(columns, path)


def _truth_columns(truth: Truth) -> dict[str, Any]:
    columns = {item.name: getattr(truth, item.name) for item in fields(truth)}
    return {name: value for name, value in columns.items() if value is not None}


def _save_npz(columns: dict[str, Any], path: str | Path) -> Path:
    path = Path(path)
    try:
        with staged_file(path) as staged, staged.open("xb") as file:
            np.savez_compressed(file, **columns)
    except OSError as error:
        raise OutputError(f"cannot write {path}: {error.strerror or error}; choose another place") from error
    return path


def load_truth(path: str | Path) -> Truth:
    """Read a file of ``save_truth``.

    Raises:
        SceneError: the file is not a truth file.
    """
    columns = _load_npz(path)
    if "time_s" in columns:
        raise SceneError(f"{path} holds the truth of a sequence; read it with load_truths")
    return _truth_from_columns(columns, path)


def load_truths(path: str | Path) -> tuple[list[Truth], NDArray[np.float64]]:
    """Read a file of ``save_truths``: the truth of every frame, and the frames' times (F,) in s.

    Raises:
        SceneError: the file is not the truth file of a sequence.
    """
    columns = _load_npz(path)
    if "time_s" not in columns:
        raise SceneError(f"{path} holds no sequence; read it with load_truth")
    time_s = columns.pop("time_s")
    try:
        frames = [{name: values[i] for name, values in columns.items()} for i in range(len(time_s))]
    except (TypeError, IndexError) as error:
        raise SceneError(f"{path} is not a truth file ({error}); write one with save_truths") from error
    return [_truth_from_columns(frame, path) for frame in frames], time_s


def _load_npz(path: str | Path) -> dict[str, Any]:
    try:
        return read_npz(path, most_bytes=MAX_DATA_BYTES)
    except InputError as error:
        raise SceneError(str(error)) from None
    except NpzError as error:
        raise SceneError(f"{path} is not a truth file ({error}); write one with save_truth") from error


def _truth_from_columns(columns: dict[str, Any], path: str | Path) -> Truth:
    try:
        mirrored = columns["mirrored"] if columns["mirrored"].ndim else bool(columns["mirrored"])
        return Truth(**{**columns, "mirrored": mirrored, "H": columns.get("H")})
    except (KeyError, TypeError) as error:
        raise SceneError(f"{path} is not a truth file ({error}); write one with save_truth") from error
