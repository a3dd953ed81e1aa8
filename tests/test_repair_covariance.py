"""Repaired and fitted markers: their covariances cover their true errors (Monte Carlo over damaged scenes)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from cmpdesign.scene import (
    Blob,
    Camera,
    Damage,
    Press,
    Twist,
    composed,
    render,
    standard_layout,
    standard_scene,
)
from cmpdesign.scene.standard import BLACK_RGB
from cmpdesign.writers.layout_file import layout_to_json
from extractor import Extractor, Status, parse_layout

LAYERS = 9
SIZE = (430, 400)
REACH_MM = 8.0
SURFACES = {
    "flat": None,
    "bulge": composed(Press(radius_mm=5.0, depth_mm=1.0)),
    "twist": composed(Twist(radius_mm=5.0, angle_deg=15.0)),
}


def damages(seed: int) -> Iterator[Damage]:
    """Cells that fell out; dirt; dark dirt; two large blots."""
    rng = np.random.default_rng(seed)

    def spots(count: int, low_mm: float, high_mm: float, rgb: tuple[float, float, float]) -> tuple[Blob, ...]:
        angle, radius = rng.uniform(0, 2 * np.pi, count), REACH_MM * np.sqrt(rng.uniform(0.04, 1, count))
        sizes = rng.uniform(low_mm, high_mm, count)
        places = zip(radius * np.cos(angle), radius * np.sin(angle), sizes, strict=True)
        return tuple(Blob((float(x), float(y)), float(r), rgb) for x, y, r in places)

    yield Damage(missing_share=0.12)
    yield Damage(blobs=spots(8, 0.4, 1.2, (120.0, 110.0, 100.0)))
    yield Damage(blobs=spots(8, 0.4, 1.2, BLACK_RGB))
    yield Damage(blobs=spots(2, 2.0, 2.4, BLACK_RGB))


@cache
def normalised(preset: str) -> dict[Status, np.ndarray]:
    """Squared errors over covariance per axis, by status, of everything that was repaired."""
    found: dict[Status, list[float]] = {Status.REPAIRED: [], Status.FITTED: []}
    for pattern in ("honeycomb", "round", "elliptical"):
        layout = standard_layout(pattern, LAYERS)
        extractor = Extractor(parse_layout(layout_to_json(layout)), preset=preset)  # type: ignore[arg-type]
        for number, surface in enumerate(SURFACES.values()):
            plain = replace(
                standard_scene(layout), surface=surface, camera=Camera(20.0, 7.3, 10.0 * number, 30.0)
            )
            for seed, damage in enumerate([*damages(2 * number), *damages(2 * number + 1)]):
                seen = render(replace(plain, damage=damage, seed=seed), size=SIZE)
                markers = extractor.extract(seen.image)
                error = markers.xy_px - seen.truth.marker_xy_px
                for status, squares in found.items():
                    mine = markers.status == status
                    inverse = np.linalg.inv(markers.cov_px2[mine])
                    squares += list(np.einsum("mi,mij,mj->m", error[mine], inverse, error[mine]) / 2)
    return {status: np.array(squares) for status, squares in found.items()}


@pytest.mark.parametrize(
    "preset",
    [
        "balanced",
        pytest.param("fast", marks=pytest.mark.slow),
        pytest.param("accurate", marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize(("status", "least"), [(Status.REPAIRED, 200), (Status.FITTED, 80)])
def test_the_covariance_of_a_repaired_marker_is_true(preset: str, status: Status, least: int) -> None:
    squares = normalised(preset)[status]
    assert len(squares) >= least
    assert 0.8 < np.sqrt(squares.mean()) < 1.3
    assert np.sqrt(squares.max()) < 6.0
