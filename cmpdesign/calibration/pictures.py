"""From pictures of a sheet to its points in them, through the reader.

Markers of the pattern's border are left out. Around an inner marker the cells lie evenly, so that errors of blur, of
the tone curve and of a JPEG's coarser colors cancel. A border marker has cells to one side: these errors move all of
them outwards or inwards, which no camera tells from another lens, and no covariance of single markers states.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.calibration.camera import MIN_POINTS
from cmpdesign.calibration.sightings import Sheet, Sighting
from cmpdesign.errors import CmpDesignError
from extractor import Extractor, Reference, Status


@dataclass(frozen=True, eq=False)
class SheetPictures:
    """The points of a sheet in its pictures.

    Attributes:
        sheet: the points.
        sightings: the pictures that show enough of them.
        unread: name -> reason, of the others.
        size_px: (width, height) of all pictures.
    """

    sheet: Sheet
    sightings: tuple[Sighting, ...]
    unread: dict[str, str]
    size_px: tuple[int, int]


def read_sheets(
    reference: Reference,
    pictures: Sequence[NDArray[Any]],
    names: Sequence[str],
    extractor: Extractor,
    watch: Callable[[int, int], None],
) -> SheetPictures:
    """Read pictures of a sheet; only inner markers that are measured count.

    Raises:
        CmpDesignError: pictures of different sizes.
    """
    sizes = {(picture.shape[1], picture.shape[0]) for picture in pictures}
    if len(sizes) > 1:
        found = ", ".join(f"{width} x {height}" for width, height in sorted(sizes))
        raise CmpDesignError(
            f"the pictures have {len(sizes)} sizes ({found} px); a calibration holds for one; calibrate each alone"
        )
    sightings, unread, inner = [], {}, inner_markers(reference)
    for number, (picture, name) in enumerate(zip(pictures, names, strict=True)):
        markers = extractor.extract(picture)
        good = np.flatnonzero(
            inner & (markers.status == Status.MEASURED) & np.isfinite(markers.cov_px2).all(axis=(1, 2))
        )
        if len(good) < MIN_POINTS:
            unread[name] = str(markers.reason) if markers.reason else f"{len(good)} inner markers measured"
        else:
            sightings.append(Sighting(name, good, markers.xy_px[good], markers.cov_px2[good]))
        watch(number + 1, len(pictures))
    size_px = sizes.pop() if sizes else (0, 0)
    return SheetPictures(Sheet(reference.xy_mm), tuple(sightings), unread, size_px)


def inner_markers(reference: Reference) -> NDArray[np.bool_]:
    """(M,) bool, the markers with cells all around: no side of a cell at them belongs to one cell alone."""
    corners = reference.cell_corners
    sides = np.sort(np.stack([corners, np.roll(corners, 1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    found, counts = np.unique(sides, axis=0, return_counts=True)
    inner = np.ones(len(reference.xy_mm), bool)
    inner[found[counts == 1]] = False
    return inner
