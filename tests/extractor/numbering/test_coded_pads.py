"""Coded pads in pictures without the reference cell and without the outline."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from benchmarks.suites.views.views import DAMAGED, DrawnView, read_view
from cmpdesign.design.design import Design
from cmpdesign.files.layout_json import layout_to_json
from cmpdesign.layout.build import build_layout
from cmpdesign.layout.layout import Layout
from cmpdesign.scene import Blob, Camera, Damage, Optics, Rendered, Scene, Sensor, render
from extractor import Extractor, Origin, Reason, parse_layout

CODE, OTHER, PLAIN = 7, 8, 0
SIZE = (290, 430)


@cache
def pad(code: int) -> Layout:
    return build_layout(Design(pattern="honeycomb", layers=10, pitch_mm=1.5, code=code))


@cache
def reader(code: int) -> Extractor:
    return Extractor(parse_layout(layout_to_json(pad(code))))


def crop(code: int, turn_deg: float, *blobs: Blob) -> Rendered:
    """A part of a pad beside its centre: the reference cell is outside the picture, and so is the outline."""
    camera = Camera(41.0, turn_deg, tilt_deg=5.0, centre_px=(305.0, 215.0))
    scene = Scene(
        pad(code), camera, optics=Optics(1.0), sensor=Sensor(noise=2.0), damage=Damage(blobs=blobs), seed=3
    )
    return render(scene, size=SIZE)


@pytest.mark.parametrize("turn_deg", [20.0, 140.0, 260.0])
def test_a_crop_is_numbered_by_its_bits(turn_deg: float) -> None:
    shot = crop(CODE, turn_deg)
    assert not shot.truth.cell_visible[pad(CODE).reference_cell]
    assert shot.truth.visible[pad(CODE).marker_layer == 10].sum() <= 1
    assert not reader(PLAIN).extract(crop(PLAIN, turn_deg).image).found
    markers = reader(CODE).extract(shot.image)
    assert markers.origin is Origin.CODE and markers.reason is None
    found = np.isfinite(markers.xy_px[:, 0])
    assert found.sum() > 70
    assert np.linalg.norm(markers.xy_px - shot.truth.marker_xy_px, axis=1)[found].max() < 0.5
    number = markers.stages["number"]
    assert number.code_misfit <= 0.02 and number.lead >= 30.0


def test_dirt_on_bits_is_unknown() -> None:
    blobs = [Blob((x, y), 0.5, (235.0, 235.0, 235.0)) for x, y in ((-5.0, 3.0), (-8.0, 6.0), (-6.0, 8.0))]
    markers = reader(CODE).extract(crop(CODE, 20.0, *blobs).image)
    assert markers.origin is Origin.CODE and markers.stages["number"].code_misfit < 0.05


@pytest.mark.parametrize(("made", "read"), [(CODE, OTHER), (PLAIN, CODE)])
def test_another_code_is_not_numbered(made: int, read: int) -> None:
    """Neither as a crop, nor in whole, where the outline and the inks alone would give numbers."""
    whole = render(
        Scene(pad(made), Camera(10.0, 20.0), optics=Optics(0.7), sensor=Sensor(noise=1.0)), size=SIZE
    )
    assert reader(made).extract(whole.image).counts["measured"] > 300
    for shot in (crop(made, 20.0), whole):
        markers = reader(read).extract(shot.image)
        assert not markers.found and np.isnan(markers.xy_px).all()
        assert markers.reason in (Reason.OTHER_CODE, Reason.AMBIGUOUS)
    assert markers.reason is Reason.OTHER_CODE


def test_a_plain_layout_does_not_number_a_coded_pad() -> None:
    for turn_deg in (20.0, 140.0):
        assert not reader(PLAIN).extract(crop(CODE, turn_deg).image).found


@pytest.mark.parametrize("number", [34, 142])
def test_bits_of_several_parts_prove_a_motion_together(number: int) -> None:
    """Covers cut these crops in parts of less than 50 cells, and no part has bits enough."""
    result = read_view(DrawnView(DAMAGED, 7302, number, CODE, (40.0, 72.0)))
    assert 60 <= result.seen.black_cells < 70 and result.reported > 100 and result.wrong_ids == 0


def test_small_cells_beside_white_ones_are_found_in_one_look() -> None:
    """At 7 px a side, at the scale of recognition."""
    layout = build_layout(Design(pattern="honeycomb", layers=16, pitch_mm=1.5, code=CODE))
    shot = render(
        Scene(layout, Camera(14.0, 7.3), optics=Optics(0.7), sensor=Sensor(noise=2.0)), size=(640, 480)
    )
    markers = Extractor(parse_layout(layout_to_json(layout))).extract(shot.image)
    assert markers.origin is Origin.CODE and markers.counts["measured"] == len(layout.marker_layer)
    assert "grow" not in markers.timings_ms  # a second look grows regions
