"""The exact Cramer-Rao bound of a scene, from derivatives of its rendered image.

``gridline_bound.cramer_rao`` treats every gridline as isolated. This module needs no such assumption: it renders the
encoded image's derivative with respect to every marker (central differences of 16-bit images with the scene's
response). The noise is that of the encoded image, so the Fisher matrix is the derivatives' Gram matrix over its
variance. Markers far from each other are shifted in the same rendering, so a few dozen renderings are sufficient for
any pattern.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from cmpdesign.libraries import extra
from cmpdesign.scene.bounds.gridline_bound import marker_covariances, noisy_sensor
from cmpdesign.scene.drawing.render import render, render_truth
from cmpdesign.scene.drawing.view import single_view
from cmpdesign.scene.parts.sensor import Sensor
from cmpdesign.scene.scene import Scene

STEP_PX = 0.1  # shift of the central differences
MIN_SEPARATION_EDGES = 3  # markers that are shifted together are more edges apart in the layout's graph
REACH_SIGMA = 5.0  # of the blur, around the cells of a marker


def exact_bound(scene: Scene, *, size: tuple[int, int] = (640, 480)) -> NDArray[np.float64]:
    """The smallest covariance (M, 2, 2) px^2 of an unbiased estimate of the markers; NaN where not visible.

    A gridline moves with its two markers and keeps its curvature. Inks, light, blur and response are assumed to be
    known. Clipped pixels have no information. JPEG and quantisation are neglected.

    Args:
        scene: a scene with noise and one view.
        size: the image's (width, height) px.

    Raises:
        SceneError: the scene has no noise.
    """
    with extra("evaluate"):
        from scipy.sparse import coo_array

    sensor = noisy_sensor(scene)
    clean = replace(scene, sensor=Sensor(bits=16, response=sensor.response))
    truth = render_truth(scene, size=size)
    markers = len(truth.visible)
    groups = _separated_groups(scene.layout.edges, markers)
    boxes = _influence_boxes(scene, truth.marker_xy_px, size)
    rows, columns, values = [], [], []
    for group in range(groups.max() + 1):
        shifted = np.flatnonzero(groups == group)
        for axis in (0, 1):
            derivative = _image_derivative(clean, shifted, axis, size)
            for marker in shifted:
                low, high = boxes[marker]
                if (high <= low).any():
                    continue
                part = derivative[low[1] : high[1], low[0] : high[0]]
                y, x, channel = np.nonzero(part)
                rows.append(((y + low[1]) * size[0] + x + low[0]) * 3 + channel)
                columns.append(np.full(len(x), 2 * marker + axis))
                values.append(part[y, x, channel] / sensor.noise)
    jacobian = coo_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
        shape=(size[0] * size[1] * 3, 2 * markers),
    ).tocsc()
    return marker_covariances((jacobian.T @ jacobian).tocsc(), truth)


def _separated_groups(edges: NDArray[np.int32], markers: int) -> NDArray[np.int64]:
    """(M,) group numbers: markers of one group are at least ``MIN_SEPARATION_EDGES`` + 1 edges apart (greedy)."""
    with extra("evaluate"):
        from scipy.sparse import coo_array, eye_array

    one = np.ones(2 * len(edges))
    directed = np.concatenate([edges, edges[:, ::-1]])
    adjacent = (coo_array((one, directed.T), shape=(markers, markers)) + eye_array(markers)).tocsr()
    reached = adjacent
    for _ in range(MIN_SEPARATION_EDGES - 1):
        reached = reached @ adjacent
    group = np.full(markers, -1)
    for marker in range(markers):
        taken = group[reached.indices[reached.indptr[marker] : reached.indptr[marker + 1]]]
        group[marker] = np.setdiff1d(np.arange(len(taken) + 1), taken)[0]
    return group


def _influence_boxes(scene: Scene, xy_px: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.int64]:
    """(M, 2, 2) int64: the box of pixels (from, to) that a marker's cells and their blur can affect."""
    edges = scene.layout.edges
    low, high = xy_px.copy(), xy_px.copy()
    for a, b in (edges.T, edges.T[::-1]):
        np.minimum.at(low, a, xy_px[b])
        np.maximum.at(high, a, xy_px[b])
    reach = REACH_SIGMA * np.hypot(scene.blur_px, 0.3) + 1
    box = np.stack([np.floor(low - reach), np.ceil(high + reach) + 1], axis=1)
    return np.asarray(np.clip(box, 0, np.asarray(size)), dtype=np.int64)


def _image_derivative(
    scene: Scene, markers: NDArray[np.int64], axis: int, size: tuple[int, int]
) -> NDArray[np.float64]:
    """(H, W, 3): derivative of the image with respect to a shift (1 px) of these markers along an image axis."""
    xy_mm = scene.layout.marker_xy_mm
    step_mm = STEP_PX * _inverse_jacobians(scene, markers, size)[:, :, axis]
    images = []
    for sign in (1, -1):
        shifted = xy_mm.copy()
        shifted[markers] += sign * step_mm
        image = render(replace(scene, layout=replace(scene.layout, marker_xy_mm=shifted)), size=size).image
        images.append(image.astype(np.float64) / 257)
    return (images[0] - images[1]) / (2 * STEP_PX)


def _inverse_jacobians(
    scene: Scene, markers: NDArray[np.int64], size: tuple[int, int]
) -> NDArray[np.float64]:
    """(n, 2, 2) mm per px: the inverse Jacobian of the map from layout to image at these markers."""
    view, xy = single_view(scene, size), scene.layout.marker_xy_mm[markers]
    step_mm = 1e-4 * np.ptp(scene.layout.marker_xy_mm)
    columns = [
        (view.image_from_layout(xy + step_mm * unit) - view.image_from_layout(xy - step_mm * unit))
        / (2 * step_mm)
        for unit in np.eye(2)
    ]
    return np.linalg.inv(np.stack(columns, axis=2))
