"""The Cramer-Rao bound of a scene: the smallest possible covariance of marker positions, gridline by gridline.

A gridline between the light a and b of a channel, blur s and pixel noise sigma has the Fisher information
(b - a)^2 / (s sigma^2) times the integral of (v'(a + (b - a) Phi(u)) phi(u))^2 over u, per pixel of its length about
its offset along its normal: the integral of the squared derivative of an encoded Gaussian edge, over sigma^2. v' is the
derivative of the value by light, which the sensor's response gives; s^2 = blur^2 + 1/12 adds the pixel's box. Channels
add up. With a linear response this is A^2 / (2 sqrt(pi) s sigma^2), A the norm of the contrast over the channels. A
gridline is straight between its two markers, so a point at the fraction t moves with the weights 1 - t and
t. All gridlines together give a sparse information matrix; the diagonal blocks of its inverse bound every
marker's covariance.

Every gridline is treated as isolated. Near a marker six gridlines share their pixels and hold less information, so the
true bound is higher. The difference grows as edges get shorter: for a deviation, about 17 % at 20 px and
blur 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cmpdesign.libraries import extra
from cmpdesign.patterns.colors import BLACK
from cmpdesign.scene.camera.pinhole import Area
from cmpdesign.scene.drawing.render import missing_cell_mask, render_truth
from cmpdesign.scene.drawing.view import single_view
from cmpdesign.scene.errors import SceneError
from cmpdesign.scene.parts.light import light_gain
from cmpdesign.scene.parts.sensor import Sensor, encoding_slope
from cmpdesign.scene.scene import Scene
from cmpdesign.scene.truth import Truth
from extractor.image.response import decode_values

# Without information about a marker the matrix would be singular: a prior with a deviation of 1000 px prevents this.
PRIOR_PER_PX2 = 1e-6
SOLVED_AT_ONCE = 512  # markers, to limit memory
PROFILE_REACH, PROFILE_NODES = 6.0, 241  # of the integral along the normal, in sigma and points


def cramer_rao(scene: Scene, *, size: tuple[int, int] = (640, 480)) -> NDArray[np.float64]:
    """The smallest covariance (M, 2, 2) px^2 that an unbiased estimate of the markers can have.

    The bound uses the scene's inks, light, blur, response, noise, missing cells and true positions. JPEG, quantisation,
    saturation by noise and the bending of gridlines are neglected. NaN for markers that are not visible.

    Args:
        scene: a scene with noise and one view.
        size: the image's (width, height) px.

    Raises:
        SceneError: the scene has no noise, or it has several views, each with its own bound.
    """
    single_view(scene, size)  # raises for several views
    truth = render_truth(scene, size=size)
    return marker_covariances(edge_information(scene, truth, size), truth)


def edge_information(scene: Scene, truth: Truth, size: tuple[int, int]) -> Any:
    """The sparse (2M, 2M) information matrix, 1/px^2, rows x0, y0, x1, y1, ... by marker.

    Raises:
        SceneError: the scene has no noise, or several views.
    """
    area = single_view(scene, size).area
    sensor = noisy_sensor(scene)
    ends = truth.marker_xy_px[scene.layout.edges]
    spread = np.sqrt(scene.blur_px**2 + 1 / 12)
    light = _light_beside_edges(scene, ends.mean(axis=1), size)
    per_px = _profile_information(sensor, light) / (spread * sensor.noise**2)
    return _sum_information(scene.layout.edges, ends, per_px, area, len(truth.marker_xy_px))


def noisy_sensor(scene: Scene) -> Sensor:
    """The scene's sensor.

    Raises:
        SceneError: the sensor has no noise.
    """
    sensor = scene.sensor or Sensor()
    if sensor.noise <= 0:
        raise SceneError(f"the sensor's noise is {sensor.noise:g}; a bound needs noise above 0 8-bit steps")
    return sensor


def _profile_information(sensor: Sensor, light: NDArray[np.float64]) -> NDArray[np.float64]:
    """(E,): the integral of the squared derivative of each edge's encoded profile, for blur 1 and noise 1.

    Args:
        sensor: the sensor.
        light: (E, 2, C) light on both sides.
    """
    with extra("evaluate"):
        from scipy.special import ndtr

    along_normal = np.linspace(-PROFILE_REACH, PROFILE_REACH, PROFILE_NODES)
    density = np.exp(-(along_normal**2)) / (2 * np.pi)
    start, contrast = light[:, 0, :, None], (light[:, 1] - light[:, 0])[..., None]
    slope = encoding_slope(sensor, start + contrast * ndtr(along_normal))
    step = along_normal[1] - along_normal[0]
    return np.asarray(np.sum((contrast * slope) ** 2 * density, axis=(1, 2)) * step)


def _light_beside_edges(
    scene: Scene, middle_px: NDArray[np.float64], size: tuple[int, int]
) -> NDArray[np.float64]:
    """(E, 2, 3): the light B, G, R on both sides of each edge, with the gain at the edge's middle."""
    layout, light_of_values = scene.layout, (scene.sensor or Sensor()).light_of_values()
    color = np.where(missing_cell_mask(scene), BLACK, layout.cell_color)
    cell_light = decode_values(
        np.array([scene.ink(c)[::-1] for c in color], dtype=np.float64), light_of_values
    )
    corners = layout.cell_corners.astype(np.int64)
    sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2)
    markers = len(layout.marker_xy_mm)
    edge_key = layout.edges[:, 0].astype(np.int64) * markers + layout.edges[:, 1]
    edge = np.searchsorted(edge_key, sides.min(axis=1) * markers + sides.max(axis=1))
    # The corners of an edge's two cells run along it in opposite directions. Beyond the rim there is black.
    black = decode_values(np.array(scene.ink(BLACK)[::-1], dtype=np.float64), light_of_values)
    light = np.tile(black, (len(edge_key), 2, 1))
    light[edge, np.where(sides[:, 0] < sides[:, 1], 1, 0)] = np.repeat(cell_light, corners.shape[1], axis=0)
    if scene.light:
        x, y = np.clip(np.rint(middle_px), 0, np.asarray(size) - 1).astype(np.int64).T
        light = light * light_gain(scene.light, size)[:, y, x].T[:, None]
    return light


def _sum_information(
    edges: NDArray[np.int32],
    ends: NDArray[np.float64],
    per_px: NDArray[np.float64],
    area: Area,
    markers: int,
) -> Any:
    """The sparse (2M, 2M) information matrix of all edges, clipped to the view's area."""
    with extra("evaluate"):
        from scipy.sparse import coo_array

    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    normal = np.stack([-along[:, 1], along[:, 0]], axis=-1) / length[:, None]
    low, high = _clip_to_area(ends, area)
    weight = per_px * length
    # Integrals of (1 - t)^2, t (1 - t) and t^2 over the part inside.
    integrals = {
        (0, 0): ((1 - low) ** 3 - (1 - high) ** 3) / 3,
        (0, 1): (high**2 - low**2) / 2 - (high**3 - low**3) / 3,
        (1, 1): (high**3 - low**3) / 3,
    }
    projectors = normal[:, :, None] * normal[:, None, :]
    row, column, value = [], [], []
    for (a, b), integral in integrals.items():
        for i, j in {(a, b), (b, a)}:
            rows = 2 * edges[:, i, None, None] + np.array([[0], [1]])
            columns = 2 * edges[:, j, None, None] + np.array([[0, 1]])
            row.append(np.broadcast_to(rows, projectors.shape).ravel())
            column.append(np.broadcast_to(columns, projectors.shape).ravel())
            value.append((projectors * (weight * integral)[:, None, None]).ravel())
    matrix = coo_array(
        (np.concatenate(value), (np.concatenate(row), np.concatenate(column))),
        shape=(2 * markers, 2 * markers),
    )
    return matrix.tocsc()


def _clip_to_area(ends: NDArray[np.float64], area: Area) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The range of t, (E,) each, over which each edge lies inside the area; empty ranges are (0, 0)."""
    start, step = ends[:, 0], ends[:, 1] - ends[:, 0]
    step = np.where(np.abs(step) < 1e-12, 1e-12, step)
    corner = np.asarray(area[:2]) - 0.5
    first, second = (corner - start) / step, (corner + np.asarray(area[2:]) - start) / step
    low = np.clip(np.minimum(first, second).max(axis=1), 0, 1)
    high = np.clip(np.maximum(first, second).min(axis=1), 0, 1)
    outside = high <= low
    return np.where(outside, 0.0, low), np.where(outside, 0.0, high)


def marker_covariances(information: Any, truth: Truth) -> NDArray[np.float64]:
    """(M, 2, 2) px^2: the diagonal blocks of the inverse information for the visible markers, NaN for others."""
    with extra("evaluate"):
        from scipy.sparse import eye_array
        from scipy.sparse.linalg import splu

    markers = len(truth.visible)
    solver = splu((information + PRIOR_PER_PX2 * eye_array(2 * markers)).tocsc())
    covariance = np.full((markers, 2, 2), np.nan)
    visible = np.flatnonzero(truth.visible)
    for first in range(0, len(visible), SOLVED_AT_ONCE):
        chosen = visible[first : first + SOLVED_AT_ONCE]
        unit = np.zeros((2 * markers, 2 * len(chosen)))
        entries = np.stack([2 * chosen, 2 * chosen + 1], axis=-1).ravel()
        unit[entries, np.arange(len(entries))] = 1.0
        solved = solver.solve(unit)[entries].reshape(len(chosen), 2, len(chosen), 2)
        covariance[chosen] = solved[np.arange(len(chosen)), :, np.arange(len(chosen)), :]
    return covariance
