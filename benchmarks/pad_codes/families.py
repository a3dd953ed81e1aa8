"""Pads of one design with different codes, told apart in drawn pictures of all or a part of a pad."""

from __future__ import annotations

from collections import Counter
from functools import cache

import numpy as np

from cmpdesign import Design, Layout, build_layout
from cmpdesign.scene import Camera, Optics, Rendered, Scene, Sensor, render
from extractor import Extractor, Markers

PITCH_PX = 20.0
SIZE = (460, 460)
WRONG_PX = 10.0  # half a pitch
VIEWS = ((64, 1.0), (64, 0.5), (4, 1 / 3))  # pads of a family, and the share of a pad in the picture


@cache
def coded_layout(layers: int, code: int) -> Layout:
    return build_layout(
        Design(pattern="honeycomb", layers=layers, pitch_mm=1.5, code=code, virtual_per_edge=0)
    )


def partial_view(layout: Layout, share: float, rng: np.random.Generator) -> Rendered:
    """A picture of whose pad one side shows only a share of the markers; of the whole pad for a share of 1."""
    turn_deg, tilt_deg, axis_deg = rng.uniform(0, 360), rng.uniform(0, 10), rng.uniform(0, 360)
    along = layout.marker_xy_mm @ [np.cos(np.radians(turn_deg)), -np.sin(np.radians(turn_deg))]
    cut_px = PITCH_PX / 1.5 * float(np.quantile(along, 1 - share))
    centre = (230.0, 230.0) if share == 1 else (-cut_px, 230.0)
    camera = Camera(PITCH_PX, turn_deg, tilt_deg, axis_deg, centre_px=centre)
    scene = Scene(layout, camera, optics=Optics(1.0), sensor=Sensor(noise=2.0), seed=int(rng.integers(2**31)))
    return render(scene, size=SIZE)


def verdict_of(markers: Markers, shot: Rendered, code: int) -> str:
    """ "right", "refused", or "wrong": another pad, or a marker that is not at its place."""
    if not markers.found:
        return "refused"
    off_px = np.linalg.norm(markers.xy_px - shot.truth.marker_xy_px, axis=1)
    return "right" if markers.code == code and np.nanmax(off_px) < WRONG_PX else "wrong"


def told_apart(
    layers: int, pads: int, share: float, pictures: int, seed: int
) -> tuple[Counter[str], Counter[str]]:
    """Verdicts of a family of the codes 1 to ``pads`` on pictures of its pads, and of as many pads outside it."""
    rng = np.random.default_rng(seed)
    reader = Extractor([coded_layout(layers, code) for code in range(1, pads + 1)], side="either")
    own: Counter[str] = Counter()
    foreign: Counter[str] = Counter()
    for number in range(pictures):
        code = number % pads + 1
        shot = partial_view(coded_layout(layers, code), share, rng)
        own[verdict_of(reader.extract(shot.image), shot, code)] += 1
        shot = partial_view(coded_layout(layers, pads + code), share, rng)
        foreign[verdict_of(reader.extract(shot.image), shot, pads + code)] += 1
    return own, foreign
