"""Markers that lie by themselves off the smooth map, as in castings: the scatter is told from bending, and covered.

Inside: the scatter of markers whose places are known exactly is told by no picture, and by no result of the reader.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.suites.calibration.damaged import DIRT_RGB, sample_spots
from benchmarks.suites.calibration.plain import scattered_layout
from benchmarks.suites.scenes import SceneCase, cached_extractor
from benchmarks.suites.scoring.calibration import squared_distances, summarise
from cmpdesign.scene import Damage, render
from extractor import Status, VirtualStatus, parse_layout
from extractor.layout.topology import Topology, topology_of
from extractor.refine.measure.marker_scatter import NO_SCATTER, MarkerScatter, measure_scatter
from extractor.refine.synthesis.gridlines import local_maps
from tests.support.layouts import small_text

NOISE_PX, EDGE_PX = 0.01, 20.0


def pattern() -> tuple[NDArray[np.float64], Topology]:
    """A pattern's markers, in units of an edge, and its topology."""
    layout = parse_layout(small_text("honeycomb", 8))
    return layout.xy_mm / 1.5, topology_of(layout)


def scatter_of(xy: NDArray[np.float64], topology: Topology) -> MarkerScatter:
    """The scatter of markers that are measured with a noise of ``NOISE_PX``."""
    maps = local_maps(xy, topology.ring_markers, topology.ring_vectors, topology.derivative_stencil)
    information = np.tile([NOISE_PX**-2, 0.0, NOISE_PX**-2], (len(xy), 1))
    return measure_scatter(xy, maps, information, topology)


def bulged(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places in px under a bulge three edges wide."""
    return EDGE_PX * xy * (1.0 + 0.1 * np.exp(-(xy**2).sum(axis=1, keepdims=True) / 18.0))


@pytest.mark.parametrize("scatter_px", [0.05, 0.2, 0.5])
def test_scatter_is_told_from_a_smooth_surface(scatter_px: float) -> None:
    xy, topology = pattern()
    moved = np.random.default_rng(0).normal(0.0, scatter_px, xy.shape)
    found = scatter_of(EDGE_PX * xy + moved, topology)
    assert np.sqrt(found.variance_px2) == pytest.approx(scatter_px, rel=0.15)
    assert found.share > 0.8
    assert scatter_of(bulged(xy), topology) == NO_SCATTER


def test_noise_is_no_scatter() -> None:
    xy, topology = pattern()
    noise = np.random.default_rng(0).normal(0.0, NOISE_PX, xy.shape)
    assert scatter_of(EDGE_PX * xy + noise, topology) == NO_SCATTER
    assert scatter_of(EDGE_PX * xy + 5 * noise, topology).share > 0.5


@pytest.mark.parametrize("preset", ["balanced", "accurate"])
def test_scattered_markers_are_as_good_as_they_say(preset: str) -> None:
    """The prior of a smooth map alone gives a z of 1.6, for virtual markers of 2, and an RMS of 0.035 px."""
    case, rng = SceneCase(layers=8), np.random.default_rng(0)
    reader = cached_extractor(case, preset)  # type: ignore[arg-type]
    d2, virtual_d2, errors = [], [], []
    for scatter_px in (0.05, 0.2, 0.5):
        scene = case.scene()
        deviation_mm = scatter_px * scene.layout.parameters["pitch_mm"] / case.pitch_px
        seen = render(
            replace(scene, layout=scattered_layout(scene.layout, deviation_mm, rng)), size=(400, 360)
        )
        markers = reader.extract(seen.image)
        assert (markers.status == Status.MEASURED).mean() > 0.99
        errors.append(markers.xy_px - seen.truth.marker_xy_px)
        d2.append(squared_distances(errors[-1], markers.cov_px2))
        measured = markers.virtual_status == VirtualStatus.MEASURED
        virtual_error = (markers.virtual_xy_px - seen.truth.virtual_xy_px)[measured]
        virtual_d2.append(squared_distances(virtual_error, markers.virtual_cov_px2[measured]))
    found, virtual = summarise(d2), summarise(virtual_d2)
    assert 0.85 < found.z.value < 1.2
    assert found.beyond.value < 0.025
    assert 0.85 < virtual.z.value < 1.2
    assert np.sqrt(np.nanmean(np.sum(np.concatenate(errors) ** 2, axis=1))) < 0.026


@pytest.mark.parametrize("kind", ["flat", "twist"])
def test_scattered_markers_of_blurred_and_bent_pads_are_as_good_as_they_say(kind: str) -> None:
    """At the rim, markers drawn where a scattered map puts them were up to 2 px off, with a stated 0.1 px."""
    d2, errors = [], []
    for pattern, scatter_px in (("honeycomb", 0.2), ("elliptical", 0.5)):
        case, rng = SceneCase(pattern, kind, 1.6, layers=8), np.random.default_rng(1)
        scene = case.scene()
        deviation_mm = scatter_px * scene.layout.parameters["pitch_mm"] / case.pitch_px
        layout = scattered_layout(scene.layout, deviation_mm, rng)
        seen = render(replace(scene, layout=layout), size=(400, 360))
        markers = cached_extractor(case).extract(seen.image)
        errors.append(markers.xy_px - seen.truth.marker_xy_px)
        d2.append(squared_distances(errors[-1], markers.cov_px2))
    found = summarise(d2)
    assert 0.8 < found.z.value < 1.2
    assert found.beyond.value < 0.02
    assert np.sqrt(np.nanmean(np.sum(np.concatenate(errors) ** 2, axis=1))) < 0.035


def test_repaired_markers_of_a_scattered_pad_are_as_good_as_they_say() -> None:
    """By the residuals of the rings alone, as on a smooth surface, z is 1.36, and 6 % are beyond three deviations."""
    case, rng = SceneCase(layers=8), np.random.default_rng(5)
    d2 = []
    for scatter_px in (0.05, 0.1, 0.2, 0.3, 0.5):
        scene = case.scene()
        deviation_mm = scatter_px * scene.layout.parameters["pitch_mm"] / case.pitch_px
        layout = scattered_layout(scene.layout, deviation_mm, rng)
        damage = Damage(blobs=sample_spots(rng, 9, (0.7, 1.2), DIRT_RGB))
        seen = render(replace(scene, layout=layout, damage=damage), size=(400, 360))
        markers = cached_extractor(case).extract(seen.image)
        repaired = markers.status == Status.REPAIRED
        error_px = (markers.xy_px - seen.truth.marker_xy_px)[repaired]
        d2.append(squared_distances(error_px, markers.cov_px2[repaired]))
    found = summarise(d2)
    assert found.count > 40
    assert 0.7 < found.z.value < 1.25
    assert found.beyond.value < 0.04
