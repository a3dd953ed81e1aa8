"""Calibration of covariances under damage: 108 pictures, three patterns on three surfaces.

    python -m benchmarks.calibration

Error over its stated deviation, per axis: the root mean square, and the median over a normal distribution's median (1
is ideal). Measured markers are listed by kind of damage; repaired and fitted markers over all kinds.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from benchmarks.support.machine import conditions_text
from cmpdesign.files.layout_json import layout_to_json
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
from extractor import Extractor, Status, parse_layout
from extractor.presets import PRESETS, Preset

DAMAGE_KINDS = ("cells missing", "dirt", "dark dirt", "blots")
CHI_SQUARE_MEDIAN_2 = np.log(2)  # of the squares per axis, in two dimensions
LAYERS, DRAWS = 9, 3
SIZE = (430, 400)
REACH_MM = 8.0
SURFACES = {
    "flat": None,
    "bulge": composed(Press(radius_mm=5.0, depth_mm=1.0)),
    "twist": composed(Twist(radius_mm=5.0, angle_deg=15.0)),
}


def sample_damages(seed: int) -> Iterator[Damage]:
    """One damage of each kind: missing cells, dirt, dark dirt, two large blots."""
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
def normalised_squares(preset: Preset) -> dict[str, NDArray[np.float64]]:
    """Squared errors over covariance per axis, of measured markers by ``DAMAGE_KINDS``, of repaired and fitted ones."""
    found: dict[str, list[float]] = {name: [] for name in (*DAMAGE_KINDS, "repaired", "fitted")}
    for pattern in ("honeycomb", "round", "elliptical"):
        layout = standard_layout(pattern, LAYERS)
        extractor = Extractor(parse_layout(layout_to_json(layout)), preset)
        for number, surface in enumerate(SURFACES.values()):
            plain = replace(
                standard_scene(layout), surface=surface, camera=Camera(20.0, 7.3, 10.0 * number, 30.0)
            )
            for seed, damage in enumerate(
                damage for draw in range(DRAWS) for damage in sample_damages(DRAWS * number + draw)
            ):
                rendered = render(replace(plain, damage=damage, seed=seed), size=SIZE)
                markers = extractor.extract(rendered.image)
                error = markers.xy_px - rendered.truth.marker_xy_px
                kind = DAMAGE_KINDS[seed % len(DAMAGE_KINDS)]
                for status, name in (
                    (Status.MEASURED, kind),
                    (Status.REPAIRED, "repaired"),
                    (Status.FITTED, "fitted"),
                ):
                    chosen = markers.status == status
                    inverse = np.linalg.inv(markers.cov_px2[chosen])
                    found[name] += list(np.einsum("mi,mij,mj->m", error[chosen], inverse, error[chosen]) / 2)
    return {name: np.array(values) for name, values in found.items()}


def main() -> int:
    for preset in PRESETS:
        print(preset)
        for name, values in normalised_squares(preset).items():
            rms, median = np.sqrt(values.mean()), np.sqrt(np.median(values) / CHI_SQUARE_MEDIAN_2)
            print(f"  {name:<14} {len(values):>6} markers   normalised {rms:5.2f}   median {median:5.2f}")
    print(conditions_text())
    return 0


if __name__ == "__main__":
    sys.exit(main())
