"""How well neighbouring cells of a pattern can be told apart in a picture, by the colors of their middles."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cmpdesign.layout.layout import Layout

SAMPLE_RADIUS = 0.25  # of the root of a cell's area, about its middle
LOW_PERCENTILE = 5.0  # of the pairs of neighbouring cells


def neighbour_contrast(image: NDArray[np.uint8], layout: Layout, marker_xy_px: NDArray[np.float64]) -> float:
    """CIE76 between the median colors of neighbouring cells of different inks: the 5th percentile of all pairs.

    Cells are neighbours if they share a marker. Cells that are not wholly in view do not count; 0 without any pair.

    Args:
        image: (H, W, 3) uint8 BGR, taken as sRGB.
        layout: the pattern of triangles.
        marker_xy_px: (M, 2) the true markers in the image, px.
    """
    lab = cell_colors_lab(image, marker_xy_px[layout.cell_corners])
    pairs = neighbour_pairs(layout)
    distance = np.linalg.norm(lab[pairs[:, 0]] - lab[pairs[:, 1]], axis=1)
    seen = distance[np.isfinite(distance)]
    return float(np.percentile(seen, LOW_PERCENTILE)) if len(seen) else 0.0


def cell_colors_lab(image: NDArray[np.uint8], corners_px: NDArray[np.float64]) -> NDArray[np.float32]:
    """(N, 3) CIELAB of the median color of a square in the middle of each triangle (N, 3, 2); NaN out of view."""
    height, width = image.shape[:2]
    middle = corners_px.mean(axis=1)
    one, two = (corners_px[:, 1:] - corners_px[:, :1]).transpose(1, 0, 2)
    radius = SAMPLE_RADIUS * np.sqrt(0.5 * np.abs(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]))
    first = np.ceil(middle - radius[:, None]).astype(int)
    last = np.floor(middle + radius[:, None]).astype(int)
    nearest = np.rint(middle).astype(int)
    first, last = np.where(first > last, nearest, first), np.where(first > last, nearest, last)
    inside = ((corners_px >= 0) & (corners_px <= (width - 1, height - 1))).all(axis=(1, 2))
    bgr = np.full((len(middle), 3), np.nan, np.float32)
    for i in np.flatnonzero(inside):
        (left, top), (right, bottom) = first[i], last[i]
        bgr[i] = np.median(image[top : bottom + 1, left : right + 1].reshape(-1, 3), axis=0) / 255
    lab = np.full_like(bgr, np.nan)
    if inside.any():
        lab[inside] = cv2.cvtColor(bgr[inside][None], cv2.COLOR_BGR2Lab)[0]
    return lab


def neighbour_pairs(layout: Layout) -> NDArray[np.int64]:
    """(P, 2) cells of different colors that share a marker, each pair once."""
    cell = np.repeat(np.arange(len(layout.cell_corners)), layout.cell_corners.shape[1])
    marker = layout.cell_corners.ravel()
    order = np.argsort(marker, kind="stable")
    around = np.split(cell[order], np.flatnonzero(np.diff(marker[order])) + 1)
    pairs = np.concatenate([np.stack(np.meshgrid(cells, cells), axis=-1).reshape(-1, 2) for cells in around])
    pairs = np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0)
    color = layout.cell_color
    return np.asarray(pairs[color[pairs[:, 0]] != color[pairs[:, 1]]])
