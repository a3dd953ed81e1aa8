"""Only markers with cells all around count for a calibration."""

from __future__ import annotations

import numpy as np
import pytest

from cmpdesign.api.layouts import reference_from
from cmpdesign.calibration.pictures import inner_markers
from cmpdesign.scene import standard_layout


@pytest.mark.parametrize(("pattern", "cells"), [("honeycomb", 6), ("round", 6), ("square", 4)])
def test_inner_markers_have_cells_all_around(pattern: str, cells: int) -> None:
    reference = reference_from(standard_layout(pattern, layers=3))
    around = np.bincount(reference.cell_corners.ravel(), minlength=len(reference.xy_mm))
    np.testing.assert_array_equal(inner_markers(reference), around == cells)
    assert 0 < (around == cells).sum() < len(around)
