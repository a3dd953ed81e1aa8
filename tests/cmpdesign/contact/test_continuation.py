"""The touched surface from the pattern below it: responses to single loads, presses, noise, unknown markers."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cmpdesign.contact import Ball, ContactError, Cube, Elastomer, Motion, SurfaceContinuation, solve
from cmpdesign.contact.elastic_layer.green import green_kernels
from cmpdesign.contact.elastic_layer.operator import interior_displacement_mm
from cmpdesign.contact.elastic_layer.patch_response import patch_response
from cmpdesign.design.design import load_design
from cmpdesign.layout.build import build_layout

PITCH_MM = 1.5
NOISE_MM = np.array([0.001, 0.001, 0.003])
XY_MM = build_layout(load_design("honeycomb", {"layers": "8", "pitch_mm": str(PITCH_MM)})).marker_xy_mm


@pytest.mark.parametrize("poisson", [0.5, 0.45])
@pytest.mark.parametrize("depth_mm", [0.0, 0.7])
def test_the_response_to_a_load_is_that_of_the_grid(poisson: float, depth_mm: float) -> None:
    """The same load in cells of a grid, by the layer's kernels in Fourier space."""
    elastomer, width_mm, step_mm = Elastomer(3.0, 0.5, poisson), 0.8, 0.125
    axis = step_mm * (np.arange(160) - 79.5)
    x, y = np.meshgrid(axis, axis)
    traction = np.exp(-(x**2 + y**2) / (2 * width_mm**2)) * np.array([0.3, -0.2, -1.0])[:, None, None]
    green = green_kernels(elastomer, step_mm, 160, depth_mm if depth_mm else None)
    expected = interior_displacement_mm(green, traction)[:, 40:120:7, 44:120:9]
    points = np.stack([x[40:120:7, 44:120:9], y[40:120:7, 44:120:9]], axis=-1).reshape(-1, 2)
    response = patch_response(elastomer, width_mm, depth_mm, 10.0).matrix(points, np.zeros((1, 2)))
    found = (response @ [0.3, -0.2, -1.0]).reshape(-1, 3)
    largest = np.abs(expected).max()
    np.testing.assert_allclose(found, expected.reshape(3, -1).T, atol=0.004 * largest)


def pressed(
    depth_mm: float, indenter: Ball | Cube, motion: Motion, seed: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Displacement (M, 3) of the surface, of the pattern, and of the pattern with noise."""
    layer = Elastomer(5.0, 0.3, 0.5, depth_mm)
    contact = solve(layer, indenter, motion, friction=0.6, size_mm=(26, 26), grid=104)
    flat = np.pad(XY_MM, [(0, 0), (0, 1)])
    surface, pattern = contact.surface()(XY_MM) - flat, contact.marker_layer()(XY_MM) - flat
    noise = np.random.default_rng(seed).normal(size=surface.shape) * NOISE_MM
    return surface, pattern, pattern + noise


@pytest.mark.slow
def test_surfaces_are_nearer_than_patterns_and_their_deviations_are_true() -> None:
    covariance = np.broadcast_to(np.diag(NOISE_MM**2), (len(XY_MM), 3, 3)).copy()
    before, after, d2 = [], [], []
    for depth_mm in (0.5, 1.0):
        continued = SurfaceContinuation(Elastomer(5.0, 0.3, 0.5, depth_mm), XY_MM, PITCH_MM)
        for seed, indenter in enumerate(
            (Ball(radius_mm=5), Ball(radius_mm=10), Cube(side_mm=6, turn_deg=20))
        ):
            motion = Motion(press_mm=0.5, shear_mm=(0.3, 0.1))
            surface, pattern, seen = pressed(depth_mm, indenter, motion, seed)
            found = continued(seen, covariance)
            error = found.displacement_mm - surface
            before.append(np.sqrt(((pattern - surface) ** 2).mean()))
            after.append(np.sqrt((error**2).mean()))
            d2.append(np.einsum("mi,mij,mj->m", error, np.linalg.inv(found.cov_mm2), error) / 3)
    ratios = np.array(after) / before
    assert ratios.max() < 0.7 and np.median(ratios) < 0.5, ratios.round(2)
    assert 0.6 < np.sqrt(np.mean(d2)) < 1.15, np.sqrt(np.mean(d2, axis=1)).round(2)


def test_a_pattern_on_the_surface_stays_what_it_is() -> None:
    surface, _, seen = pressed(0.0, Ball(radius_mm=6), Motion(press_mm=0.4), 5)
    covariance = np.broadcast_to(np.diag(NOISE_MM**2), (len(XY_MM), 3, 3)).copy()
    found = SurfaceContinuation(Elastomer(5.0, 0.3), XY_MM, PITCH_MM)(seen, covariance)
    error = found.displacement_mm - surface
    assert (np.sqrt((error**2).mean(axis=0)) < 1.15 * NOISE_MM).all()


def test_unknown_markers_stay_unknown_and_spoil_no_other() -> None:
    surface, _, seen = pressed(1.0, Ball(radius_mm=6), Motion(press_mm=0.4), 6)
    covariance = np.broadcast_to(np.diag(NOISE_MM**2), (len(XY_MM), 3, 3)).copy()
    continued = SurfaceContinuation(Elastomer(5.0, 0.3, 0.5, 1.0), XY_MM, PITCH_MM)
    seen[::9] = np.nan
    found = continued(seen, covariance)
    unknown = np.isnan(found.displacement_mm).any(axis=1)
    assert (unknown == np.isnan(seen).any(axis=1)).all()
    assert np.abs(found.displacement_mm - surface)[~unknown].max() < 0.06
    nothing = continued(np.full_like(seen, np.nan), covariance)
    assert np.isnan(nothing.displacement_mm).all() and np.isnan(nothing.cov_mm2).all()


def test_too_many_markers_are_refused() -> None:
    with pytest.raises(ContactError, match="markers is 1501; it must be at most 1500"):
        SurfaceContinuation(Elastomer(5.0, 0.3), np.zeros((1501, 2)), 1.0)
