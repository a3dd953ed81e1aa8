"""Path-traced pictures: ids and places are the truth's, nothing is invented, reasons are right; and their score."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.photoreal.__main__ import families_table, main, measured_record
from benchmarks.photoreal.page import IMAGE, page
from benchmarks.suites.photoreal.pictures import (
    NO_PATTERN,
    PICTURES_FOLDER,
    TracedPicture,
    first_of_families,
    load_pictures,
)
from benchmarks.suites.photoreal.reading import WRONG_SHARE, is_reason_right, read_picture, reference_of
from benchmarks.suites.scoring.wrong import wrong_markers
from extractor import Extractor, Markers, Reason, Status

PICTURES = load_pictures(PICTURES_FOLDER)
BY_NAME = {picture.name: picture for picture in PICTURES}
FIRST = first_of_families(PICTURES)
NOT_ALWAYS_READ = "N"  # where there is nothing to read


def read(picture: TracedPicture) -> Markers:
    return Extractor(reference_of(picture)).extract(picture.image)


@pytest.mark.parametrize("picture", FIRST, ids=lambda picture: picture.name)
def test_a_path_traced_picture_is_read_as_its_truth(picture: TracedPicture) -> None:
    result = read_picture(picture)
    assert (result.wrong_ids, result.wrong_places) == (0, 0)
    if not result.reported:
        assert picture.family in NOT_ALWAYS_READ and result.reason
        return
    assert picture.family != NO_PATTERN
    assert result.measured >= 0.9 * result.visible
    assert result.is_reason_right and not result.reason


@pytest.mark.slow
@pytest.mark.parametrize("picture", PICTURES, ids=lambda picture: picture.name)
def test_no_path_traced_picture_is_read_wrong(picture: TracedPicture) -> None:
    result = read_picture(picture)
    assert result.wrong_ids == 0
    assert picture.family != NO_PATTERN or result.reported == 0


def test_wrong_ids_and_wrong_positions_are_counted_apart() -> None:
    picture = BY_NAME["A04_round_7"]
    truth, found = picture.truth, read(picture)
    xy_px = truth.xy_px.copy()
    xy_px[[3, 4]] = xy_px[[4, 3]]  # each at the other's place
    xy_px[168] += 0.8 * (xy_px[168] - xy_px[0]) / 7  # beyond the rim
    status = np.full_like(found.status, Status.MEASURED)
    tolerance_px = WRONG_SHARE * truth.edge_px
    moved = replace(found, xy_px=xy_px, status=status)
    ids, places = wrong_markers(moved, truth.xy_px, tolerance_px)
    assert np.flatnonzero(ids).tolist() == [3, 4]
    assert np.flatnonzero(places).tolist() == [168]
    status[[3, 168]] = Status.LOST
    ids, places = wrong_markers(replace(moved, status=status), truth.xy_px, tolerance_px)
    assert (np.flatnonzero(ids).tolist(), places.any()) == ([4], False)


def test_a_reason_is_compared_with_the_truth() -> None:
    picture = BY_NAME["A04_round_7"]
    truth, found, layout = picture.truth, read(picture), reference_of(picture)
    lost = replace(found, status=np.zeros_like(found.status))
    hidden = replace(truth, visible=np.arange(len(truth.visible)) > 0)
    for reason, seen, is_right in (
        (None, truth, False),
        (Reason.NO_PATTERN, truth, False),
        (Reason.REFERENCE_LOST, truth, False),
        (Reason.REFERENCE_LOST, hidden, True),
        (Reason.FEW_MARKERS, truth, True),
    ):
        assert is_reason_right(replace(lost, reason=reason), seen, layout, True) == is_right
    assert is_reason_right(found, truth, layout, True)
    assert not is_reason_right(replace(found, reason=Reason.FEW_MARKERS), truth, layout, True)
    assert is_reason_right(replace(lost, reason=Reason.NO_PATTERN), truth, layout, False)
    assert not is_reason_right(replace(lost, reason=Reason.MIRRORED), truth, layout, False)


def test_a_folder_without_a_family_has_no_row_of_it(capsys: pytest.CaptureFixture[str]) -> None:
    results = [read_picture(BY_NAME["G00_ball"]), read_picture(BY_NAME["N00_random_triangles"])]
    assert [row[0] for row in families_table(results).rows] == ["G", "N", "A to H, O", "A to H", "all but N"]
    assert [row[0] for row in families_table(results[1:]).rows] == ["N"]
    found = page(measured_record(results))
    assert "G                 1     1" in found.blocks["photoreal"]
    assert found.pictures[IMAGE][:2] == b"\xff\xd8"
    assert main(["--family", "G", "--quick", "--processes", "1", "--each"]) == 0
    assert "G00_ball" in capsys.readouterr().out


def test_a_folder_without_pictures_is_one_clear_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main([str(tmp_path)])
    error = capsys.readouterr().err
    assert "index.json is no index of pictures" in error and "give a folder" in error
