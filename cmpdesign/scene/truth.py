"""The ground truth of an image, and its file."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cmpdesign.errors import OutputError
from cmpdesign.scene.errors import SceneError


@dataclass(frozen=True, eq=False)
class Truth:
    """Where everything is, exactly. Its fields' names are the .npz file's.

    Where the scene's camera is a tuple of V views, the fields that a view has its own values of, marked *, have a
    leading axis of V.

    Attributes:
        marker_xy_px*: (M, 2) float64, image frame ((0, 0) is the centre of the top-left pixel).
        visible*: (M,) bool: inside the image, touching at least one undamaged colored or white cell, and not
            itself under dirt or glare.
        virtual_xy_px*: (E, m, 2) float64, on the true, curved gridlines; from the smaller marker id.
        cell_visible*: (C,) bool: all corners inside the image and the cell undamaged: not missing, and less
            than half of it under dirt or glare.
        mirrored*: the pattern's back is seen.
        H*: (3, 3) float64 image-from-layout; None when a surface is not flat or a lens distorts.
        marker_xyz_mm: (M, 3) float64, the surface in the layout frame; z is 0 on a flat one.
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


def save_truth(truth: Truth, path: str | Path) -> Path:
    """Write a .npz; ``H`` is left out where there is none.

    Raises:
        OutputError: the file cannot be written; what stood there before is unchanged.
    """
    path = Path(path)
    beside = path.with_name(path.name + ".part")
    columns = {item.name: getattr(truth, item.name) for item in fields(truth)}
    try:
        with beside.open("wb") as file:
            np.savez_compressed(file, **{name: value for name, value in columns.items() if value is not None})
        beside.replace(path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise OutputError(f"cannot write {path}: {error.strerror or error}; choose another place") from error
    return path


def load_truth(path: str | Path) -> Truth:
    """Read what ``save_truth`` wrote.

    Raises:
        SceneError: the file is not a truth file.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            columns = {name: file[name] for name in file.files}
        mirrored = columns["mirrored"] if columns["mirrored"].ndim else bool(columns["mirrored"])
        return Truth(**{**columns, "mirrored": mirrored, "H": columns.get("H")})
    except (OSError, ValueError, KeyError, TypeError, EOFError) as error:
        raise SceneError(f"{path} is not a truth file ({error}); write one with save_truth") from error
