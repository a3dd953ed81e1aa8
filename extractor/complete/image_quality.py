"""The quality of an image, measured at the middles of cells: what limits the reading of its markers."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extractor.cells.cells import Cells
from extractor.image.input import estimate_noise
from extractor.image.pyramid import PyramidLevel
from extractor.layout.reference import BLACK, COLORS, Reference
from extractor.numeric.bilinear import fill_patch_mean
from extractor.numeric.compilation import compiled
from extractor.quality import UNKNOWN, Quality
from extractor.refine.measure.gridline_weights import median_edge

CELLS_PER_INK = 40  # that are sampled
SAMPLE_RADIUS = 0.08  # in edges, over which a cell's color is averaged
CLIPPED_VALUE = 253.0  # of 255, from which on a cell's mean is clipped; noise pulls it below 255
DIM_QUANTILE = 0.05  # of the cells' light; the brightest are as many
CLIPPING_STRIDE = 4  # of the pixels by which the clipping of an image without numbers is measured
# From linear sRGB to XYZ, relative to the white D65 (IEC 61966-2-1), and the limits of L*a*b* (CIE 15).
XYZ_OF_RGB = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
) / np.array([[0.9505], [1.0], [1.0890]])
LAB_STRAIGHT, LAB_SLOPE, LAB_OFFSET = (6 / 29) ** 3, (29 / 6) ** 2 / 3, 4 / 29


class SampledCells(NamedTuple):
    """The cells of a layout at which the quality is measured.

    Attributes:
        corners: (K, 3) int32 marker ids.
        color: (K,) uint8, red 0, green 1, blue 2, black 3.
    """

    corners: NDArray[np.int32]
    color: NDArray[np.uint8]


def sampled_cells(layout: Reference) -> SampledCells:
    """Up to ``CELLS_PER_INK`` cells of each color but white, spread over the layout."""
    chosen = _spread(layout.cell_color)
    return SampledCells(
        np.ascontiguousarray(layout.cell_corners[chosen]), np.ascontiguousarray(layout.cell_color[chosen])
    )


def _spread(color: NDArray[np.uint8]) -> NDArray[np.intp]:
    """Up to ``CELLS_PER_INK`` of the cells of each color but white, at equal steps of their numbers."""
    parts = []
    for one in range(BLACK + 1):
        own = np.flatnonzero(color == one)
        parts.append(own[np.linspace(0, len(own) - 1, min(len(own), CELLS_PER_INK)).astype(np.intp)])
    return np.concatenate(parts)


def measure_quality(
    view: PyramidLevel,
    cells: SampledCells,
    xy_px: NDArray[np.float64],
    edges: NDArray[np.int32],
    blur_px: float,
) -> Quality:
    """The quality of an image with numbered markers.

    Args:
        view: the image at full scale.
        cells: by ``sampled_cells``.
        xy_px: (M, 2) the markers, NaN where lost.
        edges: (E, 2) the layout's edges.
        blur_px: sigma of the blur.
    """
    edge_px = float(median_edge(xy_px, edges))
    found = _quality_at(view, _centers(xy_px, cells.corners), cells.color, edge_px)
    return _quality(found, blur_px, float(estimate_noise(view.image, xy_px, cells.corners)), edge_px)


def measure_quality_without_numbers(view: PyramidLevel, cells: Cells | None) -> Quality:
    """The quality of an image in which no cell was numbered; ``cells`` are those that were found, if any."""
    clipping = float((view.image[::CLIPPING_STRIDE, ::CLIPPING_STRIDE].max(axis=2) >= CLIPPED_VALUE).mean())
    if cells is None or len(cells.ink) == 0:
        return replace(UNKNOWN, clipping=clipping)
    color = (cells.ink - 1).astype(np.uint8)
    chosen = _spread(color)
    found = _quality_at(view, np.ascontiguousarray(cells.center_px[chosen]), color[chosen], cells.edge_px)
    return replace(_quality(found, np.nan, np.nan, cells.edge_px), clipping=clipping)


def _quality_at(
    view: PyramidLevel, center_px: NDArray[np.float64], color: NDArray[np.uint8], edge_px: float
) -> NDArray[np.float64]:
    return np.asarray(_measure(view.image, view.response.light, center_px, color, SAMPLE_RADIUS * edge_px))


def _quality(found: NDArray[np.float64], blur_px: float, noise: float, edge_px: float) -> Quality:
    """``found`` (5,): contrast, the two inks, clipping and evenness."""
    inks = ("", "") if np.isnan(found[0]) else (COLORS[int(found[1])], COLORS[int(found[2])])
    contrast, clipping, evenness = float(found[0]), float(found[3]), float(found[4])
    return Quality(float(blur_px), float(noise), contrast, inks, clipping, evenness, edge_px)


@compiled
def _centers(xy, corners):  # type: ignore[no-untyped-def]
    """(K, 2) the means of the markers (M, 2) at the corners (K, 3)."""
    out = np.empty((corners.shape[0], 2))
    for i in range(corners.shape[0]):
        a, b, c = corners[i]
        out[i, 0] = (xy[a, 0] + xy[b, 0] + xy[c, 0]) / 3.0
        out[i, 1] = (xy[a, 1] + xy[b, 1] + xy[c, 1]) / 3.0
    return out


@compiled
def _measure(image, light, center, color, radius):  # type: ignore[no-untyped-def]
    """Contrast, the two inks that differ least, clipping and evenness; NaN where unknown.

    Args:
        image: (H, W, 3) uint8 BGR.
        light: (256,) the light of each value.
        center: (K, 2) px, NaN where unknown.
        color: (K,) red 0, green 1, blue 2, black 3.
        radius: of the averaged patch, px.
    """
    flat, height, width = image.reshape(-1), image.shape[0], image.shape[1]
    values, count = np.empty((4, 3, center.shape[0])), np.zeros(4, np.int64)
    own, clipped = np.empty(3), 0
    for i in range(center.shape[0]):
        if not fill_patch_mean(flat, height, width, center[i, 0], center[i, 1], radius, own):
            continue
        k = color[i]
        for channel in range(3):
            values[k, channel, count[k]] = own[channel]
        clipped += k < 3 and max(own[0], own[1], own[2]) >= CLIPPED_VALUE
        count[k] += 1
    out, median = np.full(5, np.nan), np.full((4, 3), np.nan)
    colored = count[0] + count[1] + count[2]
    if colored == 0:
        return out
    for k in range(4):
        for channel in range(3):
            if count[k] > 0:
                median[k, channel] = _light_of(np.median(values[k, channel, : count[k]]), light)
    out[3] = clipped / colored
    _fill_contrast(median, out)
    out[4] = _evenness(values, count, median, light)
    return out


@compiled
def _light_of(value, light):  # type: ignore[no-untyped-def]
    """The light of a value between two entries of the table."""
    below = min(int(value), 254)
    return light[below] + (value - below) * (light[below + 1] - light[below])


@compiled
def _fill_contrast(median, out):  # type: ignore[no-untyped-def]
    """Write the least CIE76 difference of two inks by their light (4, 3), BGR, and which these are."""
    lab = np.empty((4, 3))
    for k in range(4):
        _fill_lab(median[k], lab[k])
    for a in range(4):
        for b in range(a):
            dl, da, db = lab[a, 0] - lab[b, 0], lab[a, 1] - lab[b, 1], lab[a, 2] - lab[b, 2]
            difference = np.sqrt(dl * dl + da * da + db * db)
            if difference < out[0] or (np.isnan(out[0]) and not np.isnan(difference)):
                out[0], out[1], out[2] = difference, b, a


@compiled
def _fill_lab(bgr, out):  # type: ignore[no-untyped-def]
    """Write L*, a*, b* of light (3,), BGR, 0 to 255."""
    f = np.empty(3)
    for k in range(3):
        ratio = 0.0
        for channel in range(3):
            ratio += XYZ_OF_RGB[k, channel] * bgr[2 - channel] / 255.0
        f[k] = np.cbrt(ratio) if ratio > LAB_STRAIGHT else LAB_SLOPE * ratio + LAB_OFFSET
    out[0], out[1], out[2] = 116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])


@compiled
def _evenness(values, count, median, light):  # type: ignore[no-untyped-def]
    """The light of the dimmest colored cells over that of the brightest; black is subtracted where it was measured."""
    ratio, cells = np.empty(count[0] + count[1] + count[2]), 0
    black = median[3].sum() if count[3] > 0 else 0.0
    for k in range(3):
        usual = median[k].sum() - black
        for i in range(count[k] if usual > 0.0 else 0):
            total = -black
            for channel in range(3):
                total += _light_of(values[k, channel, i], light)
            ratio[cells] = max(total, 0.0) / usual
            cells += 1
    if cells == 0:
        return np.nan
    ordered = np.sort(ratio[:cells])
    last = int(DIM_QUANTILE * (cells - 1) + 0.5)
    brightest = ordered[cells - 1 - last]
    return ordered[last] / brightest if brightest > 0.0 else np.nan
