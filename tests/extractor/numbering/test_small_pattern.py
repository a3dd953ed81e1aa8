"""A small pattern amid much else is numbered by its cells' centers at a reduced scale, or read as any other."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.suites.scoring.reading import cached_extractor, find_wrong_markers
from benchmarks.suites.stress.conditions import BY_NAME, matching_cases
from benchmarks.suites.stress.frames import CaseImage
from benchmarks.suites.stress.kinds import make_frame
from extractor.cells.cells import Cells
from extractor.cells.seeds import SAFE_AREA_PX, find_seeds
from extractor.layout.lattice_tables import lattice_of
from extractor.numbering.lattice_walk import Numbering
from extractor.numbering.small_pattern import fit_predicted_triangles, is_small_pattern_possible


def shot_of(name: str) -> CaseImage:
    case = matching_cases(name)[0]
    return make_frame(case, BY_NAME[case.kind]).shoot()


@pytest.mark.parametrize(
    "name", ["pattern behind=14/elliptical/200", "busy=400/honeycomb/0", "tilt=60/honeycomb/0"]
)
def test_small_cells_are_numbered_by_their_centers(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is grown, and every marker lies where it lies when all is read at full scale."""
    shot = shot_of(name)
    extractor = cached_extractor(name.split("/")[1], 11)
    markers = extractor.extract(shot.image)
    assert "grow" not in markers.stages and (markers.status == 1).all()
    monkeypatch.setattr("extractor.pipeline.is_small_pattern_possible", lambda seeds, cells: False)
    fully = extractor.extract(shot.image)
    assert "grow" in fully.stages
    apart = np.linalg.norm(markers.xy_px - fully.xy_px, axis=1)
    sigma = np.sqrt(np.trace(fully.cov_px2, axis1=1, axis2=2))
    assert (apart < 5 * sigma).all() and np.median(apart) < 0.01
    assert not find_wrong_markers(shot, markers)[0].any()


def test_what_is_not_whole_is_read_at_full_scale() -> None:
    """A cell that is gone takes the way for damage."""
    shot = shot_of("pattern behind=30/round/100")
    extractor = cached_extractor("round", 11)
    x, y = extractor.extract(shot.image).xy_px[40]
    image = shot.image.copy()
    image[round(y) - 9 : round(y) + 10, round(x) - 9 : round(x) + 10] = 20
    markers = extractor.extract(image)
    assert "grow" in markers.stages and (markers.status > 0).sum() > 385


def test_fragments_between_scratches_ask_for_no_finer_scale() -> None:
    """They are small, but the cells beside them are not."""
    shot = shot_of("scratches=5/honeycomb/0")
    markers = cached_extractor("honeycomb", 11).extract(shot.image)
    small = markers.stages["seeds"].area_px < SAFE_AREA_PX
    assert small.mean() > 0.15
    assert markers.stages["segment"].label.shape == (240, 320)
    assert (markers.status > 0).mean() > 0.95 and not find_wrong_markers(shot, markers)[0].any()


def test_noise_is_not_tried() -> None:
    """Its specks tell; and fewer domains than the pattern has cells are not amid anything."""
    noise = find_seeds(
        cached_extractor("honeycomb", 11).extract(shot_of("nothing: noise=3").image).stages["segment"]
    )
    assert not is_small_pattern_possible(noise, 363)
    shot = shot_of("busy=400/honeycomb/0")
    seeds = cached_extractor("honeycomb", 11).extract(shot.image).stages["seeds"]
    assert is_small_pattern_possible(seeds, 363) and not is_small_pattern_possible(seeds, len(seeds.ink))


def test_edges_are_looked_for_where_the_numbers_say() -> None:
    """Where they are not, or a cell is missing, there is no result."""
    extractor = cached_extractor("honeycomb", 11)
    shot = shot_of("busy=400/honeycomb/0")
    stages = extractor.extract(shot.image).stages
    lattice = lattice_of(extractor.layout)
    cells, numbering = stages["cells"], stages["attach"]
    found = fit_predicted_triangles(shot.image, cells, numbering, lattice)
    assert found is not None
    np.testing.assert_allclose(found.corner_px, cells.corner_px[found.region], atol=0.5)
    aside = Cells(cells.center_px + 12.0, cells.ink, cells.area_px, cells.corner_px)
    assert fit_predicted_triangles(shot.image, aside, numbering, lattice) is None
    fewer = numbering.cell.copy()
    fewer[fewer == 7] = -1
    incomplete = Numbering(fewer, numbering.mirrored, numbering.white_px, 0)
    assert fit_predicted_triangles(shot.image, cells, incomplete, lattice) is None
