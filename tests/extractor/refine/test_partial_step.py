"""A step around some markers: there it is a step from everything, elsewhere it is none."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import pytest

from benchmarks.suites.scoring.reading import read_case
from benchmarks.suites.stress.conditions import matching_cases
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.scene import Blob, Camera, Damage, Optics, Press, composed, render
from cmpdesign.scene.standard import BLACK_RGB, standard_layout, standard_scene
from extractor import Extractor, parse_layout
from extractor.layout.topology import Topology
from extractor.refine.drawn_pattern import Synthesis
from extractor.refine.estimate import Estimate
from extractor.refine.refinement_step import with_roughness
from extractor.refine.solve.convergence import add_neighbours
from extractor.refine.synthesis_steps import SynthesisSolver

SIZE = (300, 260)


class Step(NamedTuple):
    """A step around the markers ``anew``, those beside them ``free``, too: before, after, and from everything."""

    mesh: Topology
    anew: Any
    free: Any
    before: Estimate
    read: Synthesis
    after: Estimate
    drawn: Synthesis
    whole: Estimate


@cache
def steps(name: str) -> list[Step]:
    """All that ``accurate`` takes in an image."""
    plain, taken = SynthesisSolver._partial_step, []

    def noted(
        self: SynthesisSolver, view: Any, fit: Estimate, read: Synthesis, anew: Any, wide: bool, *how: bool
    ) -> Any:
        after, drawn = plain(self, view, fit, read, anew, wide, *how)
        start = fit._replace(xy=after.xy, beyond=after.beyond, maps=after.maps, bend=drawn.bend)
        start = start._replace(roughness=np.zeros(len(anew))) if wide else with_roughness(self._mesh, start)
        free = anew.copy()
        add_neighbours(anew, self._mesh.edges, free)
        whole = self._update_estimate(view.frame, start, drawn)
        taken.append(Step(self._mesh, anew, free, fit, read, after, drawn, whole))
        return after, drawn

    blobs = tuple(Blob(at, 0.5, BLACK_RGB) for at in ((-2.0, 1.5), (0.3, -2.4)))
    dirt, press = {"damage": Damage(blobs=blobs)}, {"surface": composed(Press(4.0, 0.6))}
    pattern, blur, pitch_px, changes = {
        "pressed": ("round", 1.0, 20.0, press),
        "dirty": ("honeycomb", 1.0, 20.0, dirt),
        "cut": ("honeycomb", 1.0, 40.0, press),
        "wide": ("elliptical", 2.0, 20.0, dirt),
    }[name]
    camera, optics = Camera(pitch_px=pitch_px, rotation_deg=7.3), Optics(blur)
    scene = replace(standard_scene(standard_layout(pattern, 5)), camera=camera, optics=optics, **changes)
    extractor = Extractor(parse_layout(layout_to_json(standard_layout(pattern, 5))), "accurate")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SynthesisSolver, "_partial_step", noted)
        extractor.extract(render(scene, size=SIZE).image)
    assert taken
    return taken


@pytest.mark.parametrize("name", ["pressed", "dirty", "cut", "wide"])
def test_a_step_around_markers_is_one_from_everything(name: str) -> None:
    """Where it solves: what beyond that would have moved hardly shows (px)."""
    for step in steps(name):
        known = np.isfinite(step.whole.measured[:, 0])
        np.testing.assert_array_equal(np.isfinite(step.after.measured[:, 0]), known)
        apart = np.linalg.norm(step.after.measured - step.whole.measured, axis=1)
        assert apart[known & step.anew].max() < 0.003
        assert apart[known & step.free].max() < 0.015
    first = steps(name)[0]
    moved = np.linalg.norm(first.after.measured - first.before.measured, axis=1)
    assert np.nanmax(moved) > 0.1 or name == "pressed"


@pytest.mark.parametrize("name", ["pressed", "dirty", "cut", "wide"])
def test_nothing_else_moves(name: str) -> None:
    for step in steps(name):
        before, after, beyond = step.before, step.after, ~step.free
        for of_markers in ("measured", "guiding", "strides"):
            was, now = getattr(before, of_markers), getattr(after, of_markers)
            np.testing.assert_array_equal(now[beyond], was[beyond])
        np.testing.assert_array_equal(after.information.diagonal[beyond], before.information.diagonal[beyond])
        others = ~step.free[step.mesh.edges].any(axis=1)
        assert before.reading is not None and after.reading is not None
        for was, now in (
            (before.bend, after.bend),
            (before.bend_variance, after.bend_variance),
            (before.information.beside, after.information.beside),
            (before.reading.weight, after.reading.weight),
            (before.reading.foot, after.reading.foot),
        ):
            np.testing.assert_array_equal(now[others], was[others])
        assert (after.sigma, after.dot_gain) == (before.sigma, before.dot_gain)
        assert after.noise == after.reading.noise == pytest.approx(step.whole.noise, rel=0.03)
        np.testing.assert_array_equal(after.levels.cell, before.levels.cell)


def test_what_lies_where_others_put_it_is_drawn_where_these_are_now() -> None:
    """A corner beyond the image's border, which was placed inside by few cells: few markers are drawn anew, but it is,
    and so leaves the image."""
    case = matching_cases("overflowing=40/elliptical")[0]
    result = read_case(case, runs=1, timing=False)[0]
    assert result.score.measured > 150 and result.score.outside == 0 and result.score.wrong == 0


def test_what_hardly_shows_is_not_guiding_afterwards() -> None:
    """A marker that guides nothing before a step around it guides nothing after it, and others are where they are
    measured."""
    for name in ("dirty", "cut"):
        for step in steps(name):
            weak = np.isnan(step.before.reliable[:, 0])
            np.testing.assert_array_equal(np.isnan(step.after.reliable[:, 0]), weak)
            sure = step.free & ~weak
            np.testing.assert_array_equal(step.after.reliable[sure], step.after.measured[sure])
    assert any(np.isnan(step.before.reliable).any() for step in steps("cut"))
