"""The compiled extractor against its plain Python twin: the same source, run without numba's compiler."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from extractor import Extractor, parse_layout
from tests.support.layouts import small_text
from tests.support.pictures import picture

ROOT = Path(__file__).parents[2]
RUN = """
import sys
import cv2, numba, numpy as np
from extractor import Extractor, load_layout
assert numba.config.DISABLE_JIT
markers = Extractor(load_layout(sys.argv[1]), side="either").extract(cv2.imread(sys.argv[2]))
np.savez(sys.argv[3], xy=markers.xy_px, cov=markers.cov_px2, status=markers.status, mirrored=markers.mirrored)
"""


@pytest.mark.parametrize(("pattern", "mirrored"), [("round", False), ("honeycomb", True)])
def test_plain_python_gives_the_same_markers(pattern: str, mirrored: bool, tmp_path: Path) -> None:
    seen = picture(pattern, 1, pitch_px=16, mirrored=mirrored, size=(64, 56))
    layout, image, out = tmp_path / "layout.json", tmp_path / "image.png", tmp_path / "markers.npz"
    layout.write_text(small_text(pattern, 1), encoding="utf-8")
    cv2.imwrite(str(image), seen.image)
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-c", RUN, str(layout), str(image), str(out)]
    result = subprocess.run(
        command, env=environment, cwd=ROOT, capture_output=True, text=True, timeout=300, check=False
    )
    assert result.returncode == 0, result.stderr
    assert "Warning" not in result.stderr
    markers = Extractor(parse_layout(small_text(pattern, 1)), side="either").extract(seen.image)
    assert markers.status.all() and markers.mirrored is mirrored
    with np.load(out) as plain:
        np.testing.assert_array_equal(plain["status"], markers.status)
        assert bool(plain["mirrored"]) is mirrored
        # light is encoded by the nearest entry of a table: rounding of 1e-16 may choose the entry beside it
        np.testing.assert_allclose(plain["xy"], markers.xy_px, rtol=0, atol=2e-6)
        np.testing.assert_allclose(plain["cov"], markers.cov_px2, rtol=1e-5, atol=1e-9)
