"""Undamaged patterns: smooth views, and markers scattered around their nominal positions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.suites.calibration.cases import CalibrationCase, frame_case, random_view
from benchmarks.suites.scenes import SCENE_KINDS, SceneCase
from benchmarks.suites.stress.frames import PATTERNS
from cmpdesign.layout.layout import Layout

BLURS_PX = (1.0, 1.6)
SCATTERS_PX = (0.05, 0.2, 0.5)
VIEWS, SCATTERED_VIEWS = 8, 12  # per pattern


def plain_cases(quick: bool, seed: int) -> Iterator[CalibrationCase]:
    """Flat, tilted, bent and twisted surfaces, two blurs, all patterns, random rotations."""
    for number, blur_px in enumerate(BLURS_PX):
        for kind in SCENE_KINDS:
            for pattern in PATTERNS:
                case = SceneCase(pattern, kind, blur_px)
                rng = np.random.default_rng(
                    [seed, 1, number, SCENE_KINDS.index(kind), PATTERNS.index(pattern)]
                )
                for _ in range(1 if quick else VIEWS):
                    yield frame_case(f"{kind}, blur {blur_px:g} px", case, random_view(case, rng))


def scattered_layout(layout: Layout, deviation_mm: float, rng: np.random.Generator) -> Layout:
    """The layout with every marker moved by a normal scatter of ``deviation_mm`` per axis; ``rng`` is advanced."""
    moved_mm = layout.marker_xy_mm + rng.normal(0.0, deviation_mm, layout.marker_xy_mm.shape)
    return replace(layout, marker_xy_mm=moved_mm)


def scatter_cases(quick: bool, seed: int) -> Iterator[CalibrationCase]:
    """Flat views of patterns with scattered markers, in px of the image per axis at edges of 20 px.

    The reader is given the nominal layout. The truth is that of the scattered layout.
    """
    for number, scatter_px in enumerate(SCATTERS_PX):
        for pattern in PATTERNS:
            case = SceneCase(pattern)
            rng = np.random.default_rng([seed, 2, number, PATTERNS.index(pattern)])
            for _ in range(1 if quick else SCATTERED_VIEWS):
                view = random_view(case, rng)
                deviation_mm = scatter_px * view.layout.parameters["pitch_mm"] / case.pitch_px
                moved = view.with_parts(layout=scattered_layout(view.layout, deviation_mm, rng))
                yield frame_case(f"{scatter_px:g} px", case, moved)
